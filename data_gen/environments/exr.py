"""OpenEXR files: the first part with R, G and B, half or float."""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.environments.layouts import Layout
from envbench.errors import BadInput


def read_exr(path: Path, check: Callable[[int, int], None]) -> tuple[NDArray[np.float32], Layout | None]:
    """Read the picture (h, w, 3), and the layout that its header states, if any.

    `check` is called with width and height before any pixel is decoded. Other channels, layers and parts are ignored.
    """
    try:
        with _quiet():
            return _read(path, check)
    except BadInput:
        raise
    except Exception as error:  # a damaged header raises RuntimeError, ValueError, UnicodeDecodeError ...
        raise BadInput(f"{path}: truncated, damaged or not an EXR file; fetch or export it again.") from error


def _read(path: Path, check: Callable[[int, int], None]) -> tuple[NDArray[np.float32], Layout | None]:
    import OpenEXR

    parts: list[Any] = OpenEXR.File(str(path), header_only=True).parts
    index, header = _rgb_part(path, parts)
    low, high = header["dataWindow"]
    if not (np.array_equal(low, header["displayWindow"][0]) and np.array_equal(high, header["displayWindow"][1])):
        raise BadInput(f"{path}: its data window is not its display window; save the whole picture, uncropped.")
    width, height = (int(n) for n in np.asarray(high, int) - low + 1)
    check(width, height)

    whole: list[Any] = OpenEXR.File(str(path), separate_channels=True).parts
    if len(whole) != len(parts):  # OpenEXR leaves out a part that it cannot decode
        raise BadInput(f"{path}: truncated or damaged EXR file; fetch or export it again.")
    planes = [whole[index].channels[name].pixels for name in "RGB"]
    if any(plane.shape != (height, width) or plane.dtype.kind != "f" for plane in planes):
        raise BadInput(f"{path}: R, G and B must be half or float at full resolution; export it so.")
    return np.stack(planes, axis=-1).astype(np.float32), _stated_layout(path, header)


def _rgb_part(path: Path, parts: list[Any]) -> tuple[int, dict[str, Any]]:
    import OpenEXR

    found: list[str] = []
    for index, part in enumerate(parts):
        names = [channel.name for channel in part.header["channels"]]
        flat = part.header.get("type", OpenEXR.scanlineimage) in (OpenEXR.scanlineimage, OpenEXR.tiledimage)
        if flat and {"R", "G", "B"} <= set(names):
            return index, part.header
        found += names
    raise BadInput(f"{path}: channels R, G and B are needed, found {', '.join(found) or 'none'}; export it as RGB.")


def _stated_layout(path: Path, header: dict[str, Any]) -> Layout | None:
    import OpenEXR

    match header.get("envmap"):
        case OpenEXR.ENVMAP_LATLONG:
            return Layout.OPENEXR
        case OpenEXR.ENVMAP_CUBE:
            raise BadInput(
                f"{path}: OpenEXR's own cube layout is not read; convert it to lat-long (exrenvmap -latlong)."
            )
        case _:
            return None


@contextlib.contextmanager
def _quiet() -> Generator[None]:
    """Keep OpenEXR's own account of a broken file off the terminal: it goes to sys.stdout and to descriptor 2."""
    kept = os.dup(2)
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
