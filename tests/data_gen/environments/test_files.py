"""Readers of environment maps: what they read, what they say, what they refuse, and that nothing crashes them."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import OpenEXR
import pytest

from data_gen.environments.files import read
from envbench import latlong
from envbench.errors import BadInput

RNG = np.random.default_rng(0)
MAP = RNG.uniform(0, 10, (8, 16, 3)).astype(np.float16)


def write_exr(path: Path, channels: Mapping[str, np.ndarray], **header: Any) -> Path:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    OpenEXR.File(header, {name: np.ascontiguousarray(plane) for name, plane in channels.items()}).write(str(path))
    return path


def rgb(pixels: np.ndarray) -> dict[str, np.ndarray]:
    return {name: np.ascontiguousarray(pixels[..., k]) for k, name in enumerate("RGB")}


def write_hdr(path: Path, rgbe: np.ndarray, header: bytes = b"FORMAT=32-bit_rle_rgbe\n") -> Path:
    """Write flat (not run-length coded) RGBE, (h, w, 4) uint8."""
    height, width = rgbe.shape[:2]
    path.write_bytes(b"#?RADIANCE\n" + header + b"\n-Y %d +X %d\n" % (height, width) + rgbe.tobytes())
    return path


def refused(path: Path, *words: str, layout: str = "latlong") -> None:
    """Expect one line that names the file and holds `words`."""
    with pytest.raises(BadInput) as caught:
        read(path, layout)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    assert all(word in message for word in words), message


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_exr_half_and_float_in_any_order_with_extras(tmp_path: Path, kind: type) -> None:
    planes = rgb(MAP.astype(kind))
    extras = {"A": np.ones((8, 16), np.uint32), "diffuse.R": planes["G"], "Z": planes["B"].astype(np.float32)}
    path = write_exr(tmp_path / "map.exr", {**extras, "B": planes["B"], "R": planes["R"], "G": planes["G"]})
    light = read(path)
    assert light.name == "map"
    assert light.notes == ()
    assert light.radiance.dtype == np.float32
    np.testing.assert_array_equal(light.radiance, MAP.astype(np.float32))


def test_exr_takes_the_part_that_has_rgb(tmp_path: Path) -> None:
    depth = OpenEXR.Part({"name": "depth"}, {"Z": np.ones((8, 16), np.float32)})
    colour = OpenEXR.Part({"name": "colour"}, rgb(MAP))
    path = tmp_path / "parts.exr"
    OpenEXR.File([depth, colour]).write(str(path))
    np.testing.assert_array_equal(read(path).radiance, MAP.astype(np.float32))


def test_exr_in_openexrs_own_grid_is_resampled(tmp_path: Path) -> None:
    theta, phi = np.pi * np.arange(33) / 32, 2 * np.pi * np.arange(64) / 63
    values = np.broadcast_to(
        (2 + np.cos(theta)[:, None] + np.sin(theta)[:, None] * np.cos(phi))[..., None], (33, 64, 3)
    )
    light = read(write_exr(tmp_path / "own.exr", rgb(values.astype(np.float32)), envmap=OpenEXR.ENVMAP_LATLONG))
    assert "OpenEXR's own lat-long grid" in light.notes[0]
    d = latlong.grid(33, 64)
    # Bilinear interpolation of a function whose second derivatives are at most 2: h^2 / 8 a dimension.
    np.testing.assert_allclose(light.radiance[..., 0], 2 + d[..., 2] + d[..., 0], atol=2 * 2 * (np.pi / 31) ** 2 / 8)


@pytest.mark.parametrize("names", ["Y", "RG", ["left.R", "left.G", "left.B"]])
def test_exr_without_rgb_names_what_it_has(tmp_path: Path, names: Any) -> None:
    path = write_exr(tmp_path / "grey.exr", dict.fromkeys(names, MAP[..., 0]))
    refused(path, "R, G and B are needed", ", ".join(sorted(names)), "export it as RGB")


def test_exr_of_integers_is_refused(tmp_path: Path) -> None:
    refused(write_exr(tmp_path / "int.exr", rgb(MAP.astype(np.uint32))), "half or float")


def test_exr_cropped_is_refused(tmp_path: Path) -> None:
    window = (np.array([0, 0], np.int32), np.array([31, 15], np.int32))
    refused(write_exr(tmp_path / "crop.exr", rgb(MAP), displayWindow=window), "uncropped")


def test_hdr_by_the_formula(tmp_path: Path) -> None:
    rgbe = RNG.integers(0, 256, (8, 16, 4), dtype=np.uint8)
    rgbe[..., 3] = RNG.integers(110, 140, (8, 16))
    rgbe[0, :4, 3] = 0  # exponent 0 means 0
    expected = rgbe[..., :3] * 2.0 ** (rgbe[..., 3:].astype(float) - 136) * (rgbe[..., 3:] > 0)
    rgbe[:, 0, 0] = 200  # 2, 2 would announce run-length coding
    expected[:, 0, 0] = 200 * 2.0 ** (rgbe[:, 0, 3].astype(float) - 136) * (rgbe[:, 0, 3] > 0)
    np.testing.assert_allclose(read(write_hdr(tmp_path / "flat.hdr", rgbe)).radiance, expected, rtol=1e-6)
    exposed = write_hdr(tmp_path / "exposed.hdr", rgbe, b"EXPOSURE=2\nFORMAT=32-bit_rle_rgbe\nEXPOSURE= 4.0\n")
    np.testing.assert_allclose(read(exposed).radiance, expected / 8, rtol=1e-6)


def test_hdr_run_length_coded(tmp_path: Path, mi: ModuleType) -> None:
    path = tmp_path / "runs.hdr"
    mi.Bitmap(np.repeat(MAP.astype(np.float32), 4, axis=1)).write(str(path))
    # Eight bits of mantissa for the largest channel: half a step, or a whole one where the writer truncates.
    expected = np.repeat(MAP.astype(np.float32), 4, axis=1)
    error = np.abs(read(path).radiance - expected) / expected.max(axis=-1, keepdims=True)
    assert error.max() <= 1 / 128


def test_reading_hdr_leaves_the_variant(tmp_path: Path, mi: ModuleType) -> None:
    read(write_hdr(tmp_path / "flat.hdr", np.full((4, 8, 4), 130, np.uint8)))
    assert mi.variant() == "llvm_ad_rgb"


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
def test_npy(tmp_path: Path, kind: type) -> None:
    np.save(tmp_path / "map.npy", MAP.astype(kind))
    light = read(tmp_path / "map.npy", name="mine")
    assert light.name == "mine"
    np.testing.assert_array_equal(light.radiance, MAP.astype(np.float32))


@pytest.mark.parametrize(
    "array", [np.ones((8, 16)), np.ones((8, 16, 4)), np.ones((8, 16, 3), int), np.ones((8, 16, 3), complex)]
)
def test_npy_of_wrong_shape_or_dtype(tmp_path: Path, array: np.ndarray) -> None:
    np.save(tmp_path / "map.npy", array)
    refused(tmp_path / "map.npy", str(array.shape), str(array.dtype), "(height, width, 3)")


def test_npy_of_objects_is_not_unpickled(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.array([{"a": 1}], object))
    refused(tmp_path / "map.npy", "save it again")


def test_layouts_are_read_from_files(tmp_path: Path) -> None:
    faces = np.zeros((4, 24, 3), np.float32)
    faces[:, 8:12] = 1  # +Y of the cube map: up
    np.save(tmp_path / "strip.npy", faces)
    light = read(tmp_path / "strip.npy", "strip")
    assert light.radiance.shape == (8, 16, 3)
    assert light([0, 0, 1]) == pytest.approx(1)
    assert light([0, 0, -1]) == pytest.approx(0)
    refused(tmp_path / "strip.npy", "24 x 4", "aspect 3:4", layout="cross")
    with pytest.raises(BadInput, match="unknown layout 'crss': did you mean 'cross'"):
        read(tmp_path / "strip.npy", "crss")


def test_missing_empty_unknown_and_folder(tmp_path: Path) -> None:
    refused(tmp_path / "none.exr", "no such file")
    for suffix in ("exr", "hdr", "npy"):
        (tmp_path / f"empty.{suffix}").touch()
        refused(tmp_path / f"empty.{suffix}", "empty")
        (tmp_path / f"junk.{suffix}").write_bytes(b"neither one nor the other" * 9)
        refused(tmp_path / f"junk.{suffix}")
    (tmp_path / "photo.jpg").touch()
    refused(tmp_path / "photo.jpg", "'.jpg'", ".exr, .hdr, .npy")
    (tmp_path / "folder.exr").mkdir()
    refused(tmp_path / "folder.exr", "no such file")


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("suffix", ["exr", "npy"])
def test_nan_and_infinity_are_refused(tmp_path: Path, bad: float, suffix: str) -> None:
    pixels = MAP.astype(np.float32)
    pixels[3, 4, 1] = bad
    path = tmp_path / f"bad.{suffix}"
    np.save(path, pixels) if suffix == "npy" else write_exr(path, rgb(pixels))
    refused(path, "1 pixels hold NaN or infinite", "mend")


def test_what_float32_cannot_hold_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.full((4, 8, 3), 1e300))
    refused(tmp_path / "map.npy", "32 pixels hold NaN or infinite")
    rgbe = np.full((4, 8, 4), 255, np.uint8)
    refused(write_hdr(tmp_path / "map.hdr", rgbe, b"FORMAT=32-bit_rle_rgbe\nEXPOSURE=1e-9\n"), "NaN or infinite")


@pytest.mark.parametrize("shape", [(1, 4), (2, 3), (1, 1)])
def test_too_small(tmp_path: Path, shape: tuple[int, int]) -> None:
    size = f"{shape[1]} x {shape[0]} pixels; at least 4 x 2"
    refused(write_exr(tmp_path / "map.exr", rgb(np.ones((*shape, 3), np.float16))), size)
    refused(write_hdr(tmp_path / "map.hdr", np.full((*shape, 4), 130, np.uint8)), size)
    np.save(tmp_path / "map.npy", np.ones((*shape, 3)))
    refused(tmp_path / "map.npy", size)


def test_too_large_is_seen_in_the_header(tmp_path: Path) -> None:
    words = ("16384 x 8192 pixels", "at most 8192 x 4096", "reduce")
    exr = write_exr(tmp_path / "map.exr", rgb(MAP))
    window = np.array([0, 0, 15, 7], "<i4").tobytes()
    exr.write_bytes(exr.read_bytes().replace(window, np.array([0, 0, 16383, 8191], "<i4").tobytes()))
    refused(exr, *words)
    hdr = tmp_path / "map.hdr"
    hdr.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8192 +X 16384\n")
    refused(hdr, *words)
    npy = tmp_path / "map.npy"
    np.lib.format.open_memmap(npy, "w+", np.float16, (8192, 16384, 3))  # a sparse file
    refused(npy, *words)


@pytest.mark.parametrize(
    "header", [b"FORMAT=32-bit_rle_xyze\n", b"", *(b"FORMAT=32-bit_rle_rgbe\nEXPOSURE=" + v for v in (b"0\n", b"x\n"))]
)
def test_hdr_of_another_kind(tmp_path: Path, header: bytes) -> None:
    refused(write_hdr(tmp_path / "map.hdr", np.full((4, 8, 4), 130, np.uint8), header), "convert it to .exr")


def test_hdr_turned(tmp_path: Path) -> None:
    path = write_hdr(tmp_path / "map.hdr", np.full((4, 8, 4), 130, np.uint8))
    path.write_bytes(path.read_bytes().replace(b"-Y 4 +X 8", b"+X 8 -Y 4"))
    refused(path, "-Y height +X width")


def test_negative_radiance_is_clamped_and_told(tmp_path: Path) -> None:
    pixels = np.ones((8, 16, 3), np.float32)
    pixels[0, 0] = -5
    np.save(tmp_path / "map.npy", pixels)
    light = read(tmp_path / "map.npy")
    assert light.radiance.min() == 0
    share = latlong.solid_angles(8, 16)[0, 0] / (4 * np.pi)  # of the sphere: the mean goes from 1 - 6 s to 1 - s
    assert light.notes == (
        f"{1 / 128:.2%} of its values were negative (down to -5): set to 0; mean energy changed by "
        f"{(1 - share) / (1 - 6 * share) - 1:+.2%}",
    )


def test_aspect_and_black_are_told(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.zeros((4, 4, 3)))
    aspect, black = read(tmp_path / "map.npy").notes
    assert "4 x 4 is not 2 : 1" in aspect
    assert "all black" in black


COMPRESSIONS = [OpenEXR.ZIP_COMPRESSION, OpenEXR.PIZ_COMPRESSION, OpenEXR.DWAB_COMPRESSION, OpenEXR.NO_COMPRESSION]


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_truncated_exr(tmp_path: Path, compression: Any, capfd: pytest.CaptureFixture[str]) -> None:
    path = write_exr(
        tmp_path / "map.exr", rgb(RNG.uniform(0, 1, (64, 128, 3)).astype(np.float16)), compression=compression
    )
    whole = path.read_bytes()
    for length in np.linspace(1, len(whole) - 1, 25).astype(int):
        path.write_bytes(whole[:length])
        refused(path)
    assert capfd.readouterr() == ("", "")  # OpenEXR's own account of it stays off the terminal


def test_truncated_hdr(tmp_path: Path, mi: ModuleType) -> None:
    path = tmp_path / "map.hdr"
    mi.Bitmap(RNG.uniform(0, 1, (32, 64, 3)).astype(np.float32)).write(str(path))
    whole = path.read_bytes()
    for length in np.linspace(1, len(whole) - 1, 25).astype(int):
        path.write_bytes(whole[:length])
        refused(path)


def test_truncated_npy(tmp_path: Path) -> None:
    path = tmp_path / "map.npy"
    np.save(path, MAP)
    whole = path.read_bytes()
    for length in np.linspace(1, len(whole) - 1, 25).astype(int):
        path.write_bytes(whole[:length])
        refused(path, "truncated")


@pytest.mark.parametrize("suffix", ["exr", "hdr", "npy"])
def test_flipped_bits_never_crash(tmp_path: Path, mi: ModuleType, suffix: str) -> None:
    path = tmp_path / f"map.{suffix}"
    pixels = RNG.uniform(0, 1, (16, 32, 3)).astype(np.float32)
    match suffix:
        case "exr":
            write_exr(path, rgb(pixels), compression=OpenEXR.DWAB_COMPRESSION)
        case "hdr":
            mi.Bitmap(pixels).write(str(path))
        case _:
            np.save(path, pixels)
    whole = path.read_bytes()
    rng = np.random.default_rng(5)
    for round_ in range(100):
        damaged = bytearray(whole)
        reach = 400 if round_ % 2 else len(whole)  # every other time the header
        for position in rng.integers(0, reach, 3):
            damaged[position] ^= 1 << rng.integers(0, 8)
        path.write_bytes(bytes(damaged))
        with contextlib.suppress(BadInput):  # anything else fails the test, and a crash ends it
            assert np.isfinite(read(path).radiance).all()


def test_captured_files_of_others(shared_data: Path) -> None:
    # Solid-angle means as data/README.md prints them, to its four digits.
    means = {
        "uffizi.hdr": (0.8947, 0.8679, 0.9876),
        "apartment.hdr": (0.8128, 0.7026, 0.6418),
        "grace.exr": (2.864, 1.586, 1.964),
    }
    for name, mean in means.items():
        np.testing.assert_allclose(read(shared_data / "environments" / name).mean, mean, rtol=5e-4)
