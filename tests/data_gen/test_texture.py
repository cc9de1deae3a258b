"""Textures: files against what was written, sRGB by its definition, bilinear lookup against Mitsuba's."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from data_gen.texture import build, modulation, read
from envbench.errors import BadInput, NeedsData
from envbench.geometry import Points
from envbench.material import Texture


def points_at(uv: np.ndarray | None) -> Points:
    n = 1 if uv is None else len(uv)
    z = np.broadcast_to([0.0, 0.0, 1.0], (n, 3))
    return Points(z, z, z, z, z, np.full(n, 1 / n), uv=uv)


@pytest.fixture
def random() -> Texture:
    return Texture("random", np.random.default_rng(0).random((5, 7, 3)).astype(np.float32))


def test_texels_are_centred_and_repeat(random: Texture) -> None:
    row, column = np.indices((5, 7)).reshape(2, -1)
    uv = np.stack([(column + 0.5) / 7, (row + 0.5) / 5], axis=-1)
    for turn in (0, -3, 2):
        assert modulation(random, points_at(uv + turn)) == pytest.approx(random.values.reshape(-1, 3), abs=1e-12 * 100)


def test_between_texels_it_is_their_mean(random: Texture) -> None:
    got = modulation(random, points_at(np.array([[1.0, 0.5 / 5], [0.5 / 7, 0.0]])))
    assert got[0] == pytest.approx((random.values[0, 6] + random.values[0, 0]) / 2, abs=1e-7)
    assert got[1] == pytest.approx((random.values[4, 0] + random.values[0, 0]) / 2, abs=1e-7)


def test_lookup_is_that_of_mitsuba(mi: ModuleType, random: Texture) -> None:
    import drjit as dr

    uv = np.random.default_rng(1).uniform(-1, 2, (500, 2))
    plugin = mi.load_dict({
        "type": "bitmap", "data": mi.TensorXf(random.values), "raw": True, "filter_type": "bilinear",
        "wrap_mode": "repeat",
    })  # fmt: skip
    si = dr.zeros(mi.SurfaceInteraction3f, len(uv))
    si.uv = mi.Point2f(uv.T.astype(np.float32).copy())
    assert modulation(random, points_at(uv)) == pytest.approx(plugin.eval_3(si).numpy().T, abs=1e-5)


@pytest.mark.parametrize(("depth", "steps"), [(np.uint8, 255), (np.uint16, 65535)])
def test_pictures_are_decoded_from_srgb(tmp_path: Path, depth: Any, steps: int) -> None:
    from skimage import io

    if depth is np.uint16:
        pixels = np.array([[0, 2000, 30000], [9000, 65535, 52428]], np.uint16)  # grey: 16-bit colour is not written
    else:
        pixels = np.random.default_rng(2).integers(0, 256, (4, 6, 3)).astype(np.uint8)
    io.imsave(tmp_path / "a.png", pixels, check_contrast=False)
    encoded = pixels / steps
    exact = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    exact = np.repeat(exact[..., None], 3, axis=2) if exact.ndim == 2 else exact
    texture = read(tmp_path / "a.png")
    assert texture.values == pytest.approx(exact, abs=1e-6)
    assert texture.name == "a"


def test_linear_files_are_taken_as_they_are(tmp_path: Path, random: Texture, mi: ModuleType) -> None:
    np.save(tmp_path / "a.npy", random.values)
    mi.Bitmap(random.values).write(str(tmp_path / "a.exr"))
    assert np.array_equal(read(tmp_path / "a.npy").values, random.values)
    assert np.array_equal(build(str(tmp_path / "a.exr")).values, random.values)


def test_generated_kinds() -> None:
    gradient = build({"kind": "gradient", "colours": [[0, 0, 0], [1, 0.5, 0.25]]})
    assert gradient.values[-1, 0].tolist() == [1, 0.5, 0.25]
    middle = modulation(gradient, points_at(np.array([[0.3, 0.5]])))
    assert middle[0] == pytest.approx([0.5, 0.25, 0.125], abs=1e-6)
    checker = build({"kind": "checker", "squares": 3, "colours": [[0, 0, 0], [1, 1, 1]]})
    assert checker.values[..., 0].tolist() == [[0, 1, 0], [1, 0, 1], [0, 1, 0]]


def test_points_without_uv_are_refused(random: Texture) -> None:
    with pytest.raises(BadInput, match="needs points with uv"):
        modulation(random, points_at(None))


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.png", b"\x89PNG\r\n\x1a\nnot", "truncated, damaged or no picture"),
        ("a.tif", b"", "is no texture's"),
        ("a.npy", b"\x93NUMPY", "truncated, damaged"),
        ("a.exr", b"", "truncated, damaged"),
    ],
)
def test_bad_files(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(BadInput, match=words) as error:
        read(tmp_path / name)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.full((2, 2, 3), 1.5), "from 1.5 to 1.5; a texture lies in"),
        (np.full((2, 2, 3), np.nan), "values from nan"),
        (np.zeros((2, 2)), "is needed"),
        (np.zeros((2, 2, 3), np.uint8), "is needed"),
    ],
)
def test_bad_arrays(tmp_path: Path, values: np.ndarray, words: str) -> None:
    np.save(tmp_path / "a.npy", values)
    with pytest.raises(BadInput, match=words):
        read(tmp_path / "a.npy")


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ({"kind": "checkr"}, "did you mean 'checker'"),
        ({"kind": "checker", "sqares": 2}, "did you mean 'squares'"),
        ({"kind": "checker", "squares": 0}, "squares must be an int"),
        ({"kind": "gradient", "colours": [[0, 0, 2], [0, 0, 0]]}, "two of three numbers"),
        ({"kind": "gradient", "colours": 3}, "two of three numbers"),
        (3, "path of a picture, or a table"),
    ],
)
def test_bad_tables(spec: Any, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        build(spec, "mine")


def test_a_missing_file_needs_data() -> None:
    with pytest.raises(NeedsData):
        build("nowhere.png")
