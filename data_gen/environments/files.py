"""Environment maps from files: EXR, Radiance HDR and NumPy arrays."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from data_gen.environments.exr import read_exr
from data_gen.environments.layouts import Layout, check_aspect, to_latlong
from data_gen.environments.rgbe import read_rgbe
from envbench import latlong
from envbench.environment import Environment
from envbench.errors import BadInput, unknown

MAX_PIXELS = 8192 * 4096
"""Largest picture that is read, so that memory stays bounded: Mitsuba takes up to 11 GB to make a light of it."""

SUFFIXES = (".exr", ".hdr", ".npy")


def read(path: str | Path, layout: str = Layout.LATLONG, name: str | None = None) -> Environment:
    """Read an environment map.

    Parameters
    ----------
    path : str or Path
        ``.exr`` (half or float, channels R, G, B), ``.hdr`` (Radiance RGBE) or ``.npy`` (array (h, w, 3) of floats).
    layout : str
        One of `Layout`: latlong, openexr-latlong, probe, cross, strip.
    name : str, optional
        The file's stem by default.

    Raises
    ------
    BadInput
        For a file that is missing, empty, truncated, damaged or of another kind, of the wrong aspect, smaller than
        4 x 2 or larger than `MAX_PIXELS`, or that holds NaN or infinite radiance.
    """
    path = Path(path)
    if layout not in list(Layout):
        raise unknown("layout", str(layout), Layout)
    notes: list[str] = []
    with np.errstate(all="ignore"):  # what overflows is found below
        pixels, stated = _decoded(path, Layout(layout))
        if stated and layout == Layout.LATLONG:
            layout = stated
            notes.append("its header says OpenEXR's own lat-long grid (poles on rows): resampled to pixel centres")
        radiance = to_latlong(pixels, Layout(layout))
    if not np.isfinite(radiance).all():
        bad = int((~np.isfinite(radiance)).any(axis=-1).sum())
        raise BadInput(f"{path}: {bad} pixels hold NaN or infinite radiance; mend the map first.")
    radiance, more = _told(radiance)
    return Environment(name or path.stem, radiance, (*notes, *more))


def _decoded(path: Path, layout: Layout) -> tuple[NDArray[np.float32], Layout | None]:
    if path.suffix.lower() not in SUFFIXES:
        raise BadInput(f"{path}: suffix '{path.suffix}' is not read; convert it to one of {', '.join(SUFFIXES)}.")
    if not path.is_file():
        raise BadInput(f"{path}: no such file; give a path that is absolute or relative to where you are.")

    def check(width: int, height: int) -> None:
        if width * height > MAX_PIXELS:
            raise BadInput(f"{path}: {width} x {height} pixels; at most 8192 x 4096 are read: reduce it first.")
        try:
            check_aspect(layout, width, height)
        except BadInput as error:
            raise BadInput(f"{path}: {error}") from None

    try:
        with path.open("rb") as file:
            empty = not file.read(1)
        if empty:
            raise BadInput(f"{path}: the file is empty; fetch or export it again.")
        match path.suffix.lower():
            case ".exr":
                return read_exr(path, check)
            case ".hdr":
                return read_rgbe(path, check), None
            case _:
                return _array(path, check), None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}); check its permissions.") from error


def _array(path: Path, check: Callable[[int, int], None]) -> NDArray[np.float32]:
    try:
        array: NDArray[np.generic] = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # ValueError, EOFError, SyntaxError in a damaged header ...
        raise BadInput(f"{path}: truncated, damaged or not a plain .npy array; save it again.") from error
    if array.ndim != 3 or array.shape[2] != 3 or array.dtype.kind != "f":
        raise BadInput(f"{path}: shape {array.shape}, dtype {array.dtype}; a float array (height, width, 3) is needed.")
    check(array.shape[1], array.shape[0])
    return np.array(array, np.float32)


def _told(radiance: NDArray[np.float32]) -> tuple[NDArray[np.float32], list[str]]:
    """Clamp negative radiance; return the notes that the map calls for."""
    height, width = radiance.shape[:2]
    notes: list[str] = []
    lowest = float(radiance.min())
    if lowest < 0:
        clamped = np.maximum(radiance, 0)
        weight = latlong.solid_angles(height, width)[..., None]
        before, after = (float((values * weight).sum()) for values in (radiance, clamped))
        change = f"changed by {after / before - 1:+.2%}" if before > 0 else "was not positive before"
        share = float((radiance < 0).mean())
        notes.append(f"{share:.2%} of its values were negative (down to {lowest:.4g}): set to 0; mean energy {change}")
        radiance = clamped
    if width != 2 * height:
        notes.append(f"{width} x {height} is not 2 : 1: angles follow from rows and columns")
    if not radiance.any():
        notes.append("all black: results are zero and have no relative error")
    return radiance, notes
