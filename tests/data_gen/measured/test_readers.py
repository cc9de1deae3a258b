"""Readers of measurements: values against published checks, orthonormality, and files that cannot be used."""

from __future__ import annotations

import shutil
import struct
from pathlib import Path

import numpy as np
import pytest

from data_gen.measured import KINDS, PRESETS, cornell, curet, merl, nbrdf
from data_gen.measured.table import coordinates
from data_gen.measured.tabulation import pairs
from envbench import llvm
from envbench.directions import from_angles
from envbench.errors import BadInput

NORMAL = np.array([0.0, 0.0, 1.0])


def at(*degrees: float) -> np.ndarray:
    return from_angles(*np.deg2rad(np.array(degrees)))[None]


def value(material: object, light: np.ndarray, view: np.ndarray) -> np.ndarray:
    (lobe,) = material.lobes
    return np.stack(lobe.evaluate(light.T, view.T, view.T, NORMAL), -1) / light[:, 2:]


@pytest.mark.parametrize(
    ("material", "light", "expected"),
    [  # the data folder's README, wi at (30, 20) degrees
        ("gray-plastic", (30, 110), (0.03348, 0.03337, 0.03024)),
        ("gray-plastic", (60, 20), (0.03144, 0.03138, 0.02965)),
        ("pink-felt", (30, 110), (0.1039, 0.07297, 0.0622)),
        ("pink-felt", (60, 20), (0.08926, 0.06149, 0.05795)),
        ("nickel", (30, 110), (0.00353, 0.003086, 0.00295)),
        ("nickel", (60, 20), (0.001075, 0.00088, 0.0007906)),
        ("white-fabric", (30, 110), (0.1061, 0.0727, 0.04663)),
        ("white-fabric", (60, 20), (0.09771, 0.06822, 0.04918)),
    ],
)
def test_networks_give_the_published_values(
    shared_data: Path, material: str, light: tuple[float, float], expected: tuple[float, ...]
) -> None:
    network = nbrdf.read(shared_data / "brdfs/nbrdf/weights.npz", material)
    # "wi" is the first argument; three digits, the fourth by rounding
    assert network(at(30, 20), at(*light))[0] == pytest.approx(np.array(expected), rel=1e-3)


@pytest.mark.parametrize(
    ("name", "expected"),
    [  # README: (theta_i, theta_o, phi) = (30, 30, 180), (30, 30, 90), (60, 45, 0)
        ("rgl-paper-white", [(0.2828, 0.2864, 0.3324), (0.2655, 0.2701, 0.3165), (0.2476, 0.2523, 0.2974)]),
        ("rgl-colodur-napoli-4f", [(0.0912, 0.0306, 0.0308), (0.0766, 0.0174, 0.0186), (0.0834, 0.0166, 0.0197)]),
    ],
)
def test_rgl_gives_the_published_values(
    shared_data: Path, name: str, expected: list[tuple[float, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ENVBENCH_DATA", str(shared_data))
    llvm.mitsuba("llvm_ad_rgb")
    material = KINDS["rgl"](PRESETS[name], name)
    views = np.concatenate([at(30, 0), at(30, 0), at(60, 0)])
    lights = np.concatenate([at(30, 180), at(30, 90), at(45, 0)])
    # the table is within 1 % RMS of the plugin, and these are ordinary directions
    assert value(material, lights, views) == pytest.approx(np.array(expected), rel=0.03)


def test_mitsubas_variant_is_given_back(shared_data: Path, mi: object) -> None:
    before = mi.variant()
    cornell.colours()
    assert mi.variant() == before


def test_a_flat_spectrum_is_white_and_a_red_one_red() -> None:
    assert cornell.colours().sum(1) == pytest.approx(np.ones(3), abs=1e-12)
    red = cornell.colours() @ (cornell.WAVELENGTHS > 600)
    assert red[0] > 5 * max(abs(red[1]), abs(red[2]))


def test_cornell_interpolation_is_the_slow_and_obvious_one(shared_data: Path) -> None:
    scattered = cornell.read(shared_data / "brdfs/cornell/krylon_blue.brdf")
    light, view = pairs(64)
    got = scattered(light, view)
    for k in range(64):
        (ti, pi), (to, po) = ((np.arccos(v[k, 2]), np.arctan2(v[k, 1], v[k, 0])) for v in (light, view))
        turn = abs(pi - po)
        turn = min(turn, 2 * np.pi - turn)
        q = np.array([np.sin(ti) * np.sin(to), turn / np.pi, np.cos(ti) * np.cos(to)])
        square = np.sum((scattered.points - q) ** 2, axis=1)
        reach = 0.001
        while np.sum(square <= reach) < 3:
            reach *= 2
        weight = np.exp(-100 * square) * (square <= reach)
        assert got[k] == pytest.approx(weight @ scattered.values / weight.sum(), rel=1e-6)


def test_the_curet_basis_is_orthonormal() -> None:
    """Gauss-Legendre in cos theta and the trapezoid in the turn integrate degree 8 products exactly."""
    x, w = np.polynomial.legendre.leggauss(12)
    theta, w = np.arccos((x + 1) / 2), w / 2
    turns = 2 * np.pi * np.arange(20) / 20
    i, o, turn = (a.ravel() for a in np.meshgrid(theta, theta, turns, indexing="ij"))
    weight = (w[:, None, None] * w[None, :, None] * np.ones(20) * (2 * np.pi) ** 2 / 20).ravel()
    values = curet.basis(i, o, turn)
    assert values.shape[1] == 55
    assert (values * weight[:, None]).T @ values == pytest.approx(np.eye(55), abs=1e-10)


def test_curet_fits(shared_data: Path) -> None:
    folder = shared_data / "brdfs/curet"
    felt, moss = curet.fit(folder, "felt"), curet.fit(folder, 61)
    assert felt.masked == 0
    assert moss.masked == 42  # of the folder's README
    assert felt.residual < felt.left_out < 0.1
    assert curet.fit(folder, 1).coefficients == pytest.approx(felt.coefficients)
    light, view = pairs(256)
    assert felt(light, view) == pytest.approx(felt(view, light))  # reciprocal
    rows = np.loadtxt(folder / "table.txt")
    measured = np.loadtxt(folder / "abrdf.dat")[0, 1:]
    got = felt(from_angles(rows[:, 3], rows[:, 4]), from_angles(rows[:, 1], rows[:, 2]))[:, 0]
    assert np.sqrt(np.mean((got - measured) ** 2) / np.mean(measured**2)) == pytest.approx(felt.residual)


def merl_file(path: Path) -> np.ndarray:
    """Write f = 0.2 + exp(-(theta_h / 0.3)^2) with a part odd in phi_d, and holes below the horizon."""
    i, j, k = np.meshgrid(*(np.arange(n) + 0.5 for n in merl.SHAPE), indexing="ij")
    theta_h, theta_d, phi_d = np.pi / 2 * (i / 90) ** 2, np.deg2rad(j), np.deg2rad(k)
    f = 0.2 + np.exp(-((theta_h / 0.3) ** 2)) + 0.05 * np.sin(2 * phi_d)
    below = np.cos(theta_h) * np.cos(theta_d) < np.sin(theta_h) * np.sin(theta_d) * np.abs(np.cos(phi_d))
    planes = np.where(below, -1.0, f) / merl.SCALE[:, None, None, None]
    path.write_bytes(struct.pack("<3i", *merl.SHAPE) + planes.astype("<f8").tobytes())
    return planes


@pytest.fixture(scope="module")
def merl_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("merl") / "nickel.binary"
    merl_file(path)
    return path


def test_merl(merl_path: Path) -> None:
    material = KINDS["merl"]({"kind": "merl", "path": str(merl_path)}, "mine")
    light, view = pairs(2048)
    t = coordinates(light.T, view.T, NORMAL)[0]
    expected = 0.2 + np.exp(-((np.arctan2(t**2, 1 - t**2) / 0.3) ** 2))
    got = value(material, light, view)
    assert got[:, 1] == pytest.approx(got[:, 0])
    # MERL's own cells of 2 degrees: (2 deg / 0.3)^2 / 8 of the peak, beside the table's 1 %
    assert np.sqrt(np.mean((got[:, 0] - expected) ** 2) / np.mean(expected**2)) < 0.012
    assert any("mirror image changed it by" in note for note in material.notes)  # 0.05 sin(2 phi_d)
    assert any("sha256 differs" in note for note in material.notes)  # it is not the published nickel


def test_built_once(merl_path: Path) -> None:
    spec = {"kind": "merl", "path": str(merl_path)}
    assert KINDS["merl"](spec, "a").lobes[0].table is KINDS["merl"](spec, "b").lobes[0].table


def test_presets_list_without_data() -> None:
    assert len(PRESETS) == 5 + 5 + 61 + 20
    assert PRESETS["curet-01-felt"] == {"kind": "curet", "sample": 1}
    assert {spec["kind"] for spec in PRESETS.values()} <= set(KINDS)


@pytest.mark.parametrize(
    ("kind", "spec", "words"),
    [
        ("curet", {"sample": 62}, "1 to 61"),
        ("curet", {"sample": 0}, "1 to 61"),
        ("curet", {"sample": "velvett"}, "did you mean 'velvet'"),
        ("curet", {"sample": True}, "must say which"),
        ("curet", {}, "must say which"),
        ("nbrdf", {"material": "red-velvet"}, "unknown material"),
        ("nbrdf", {"materiel": "nickel"}, "did you mean 'material'"),
        ("rgl", {}, "path must name a file"),
        ("rgl", {"path": "brdfs/curet/table.txt"}, "no RGL measurement"),
        ("merl", {"path": "brdfs/curet/table.txt"}, "34992012 bytes"),
        ("cornell", {"path": "brdfs/curet/table.txt"}, "wavelengths"),
        ("cornell", {"path": "brdfs/nbrdf/weights.npz"}, "not the numbers"),
        ("nbrdf", {"material": "nickel", "path": "brdfs/curet/table.txt"}, "no archive"),
        ("merl", {"path": "brdfs/curet"}, "no such file"),
        ("merl", {"path": "nowhere.binary"}, "neither there nor"),
    ],
)
def test_bad_tables(
    shared_data: Path, kind: str, spec: dict[str, object], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ENVBENCH_DATA", str(shared_data))
    with pytest.raises(BadInput, match=words) as error:
        KINDS[kind]({"kind": kind, **spec}, "mine")
    assert "\n" not in str(error.value)


def damaged(data: bytes, how: str) -> bytes:
    match how:
        case "empty":
            return b""
        case "short":
            return data[: len(data) // 2]
        case "long":
            return data + b"1"
        case "huge header":  # tensor file: dimensions of a field far beyond the file
            at = data.index(b"luminance") + 9 + 2 + 1 + 8
            return data[:at] + struct.pack("<Q", 1 << 62) + data[at + 8 :]
        case "nan":
            return data[:-400] + np.full(100, np.nan, "<f4").tobytes()
        case "zero":
            return data[:12] + bytes(len(data) - 12)
        case _:
            return b"\x93NUMPY" + data[6:]


@pytest.mark.parametrize("how", ["empty", "short", "magic", "huge header"])
def test_damaged_rgl(shared_data: Path, tmp_path: Path, how: str) -> None:
    data = (shared_data / "brdfs/rgl/paper_white_rgb.bsdf").read_bytes()
    path = tmp_path / "x.bsdf"
    path.write_bytes(damaged(data, how))
    with pytest.raises(BadInput) as error:
        KINDS["rgl"]({"kind": "rgl", "path": str(path)}, "mine")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("how", ["empty", "short", "long", "magic", "zero"])
def test_damaged_merl(merl_path: Path, tmp_path: Path, how: str) -> None:
    path = tmp_path / "x.binary"
    path.write_bytes(damaged(merl_path.read_bytes(), how))
    with pytest.raises(BadInput) as error:
        merl.read(path)
    assert "\n" not in str(error.value)


def test_merl_with_nan(merl_path: Path, tmp_path: Path) -> None:
    path = tmp_path / "x.binary"
    data = merl_path.read_bytes()
    path.write_bytes(data[:-8] + struct.pack("<d", np.nan))
    with pytest.raises(BadInput, match="NaN"):
        merl.read(path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text[: len(text) // 2], "cut short|not the numbers"),
        (lambda text: text.rsplit(None, 1)[0], "cut short"),
        (lambda text: text.rsplit(None, 1)[0] + " nan", "NaN"),
        (lambda text: text.rsplit(None, 1)[0] + " word", "not the numbers"),
        (lambda text: text.replace("400 410", "401 410"), "wavelengths"),
    ],
)
def test_damaged_cornell(shared_data: Path, tmp_path: Path, change: object, words: str) -> None:
    path = tmp_path / "x.brdf"
    path.write_text(change((shared_data / "brdfs/cornell/krylon_blue.brdf").read_text()))
    with pytest.raises(BadInput, match=words):
        cornell.read(path)


def test_damaged_curet(shared_data: Path, tmp_path: Path) -> None:
    for name in ("table.txt", "abrdf.dat"):
        shutil.copy(shared_data / "brdfs/curet" / name, tmp_path / name)
    rows = (tmp_path / "abrdf.dat").read_text().splitlines()
    for lines, words in (
        (rows[:-1], "61 rows of 206"),
        (rows[::-1], "numbered from 1"),
        ([" ".join([row.split()[0]] + ["0"] * 205) for row in rows], "55 are needed"),
    ):
        (tmp_path / "abrdf.dat").write_text("\n".join(lines))
        with pytest.raises(BadInput, match=words):
            curet.fit(tmp_path, 3)


def test_networks_of_another_shape_or_with_nan(shared_data: Path, tmp_path: Path) -> None:
    with np.load(shared_data / "brdfs/nbrdf/weights.npz") as archive:
        arrays = dict(archive)
    for change, words in (({"W1": arrays["W1"][:, :5]}, "shape"), ({"b3": arrays["b3"] * np.nan}, "NaN")):
        np.savez(tmp_path / "w.npz", **(arrays | change))
        with pytest.raises(BadInput, match=words):
            nbrdf.read(tmp_path / "w.npz", "nickel")
