"""Radiance .hdr files (RGBE): the header is read here, the pixels by Mitsuba, which detects truncation.

A value is mantissa * 2^(exponent - 136), exponent 0 meaning 0, over the header's EXPOSURE.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from envbench import llvm
from envbench.errors import BadInput

_HEADER_BYTES = 1 << 16


def read_rgbe(path: Path, check: Callable[[int, int], None]) -> NDArray[np.float32]:
    """Read the picture (h, w, 3); `check` is called with width and height before any pixel is decoded."""
    with path.open("rb") as file:
        head = file.read(_HEADER_BYTES)
    fields, _, rest = head.partition(b"\n\n")
    size = re.match(rb"-Y (\d{1,9}) \+X (\d{1,9})\n", rest)
    if not head.startswith(b"#?"):
        raise BadInput(f"{path}: not a Radiance file (no '#?' at its start); convert it to .exr.")
    if not size or b"FORMAT=32-bit_rle_rgbe" not in fields.splitlines():
        raise BadInput(f"{path}: RGBE with '-Y height +X width' is needed in its header; convert it to .exr.")
    height, width = int(size[1]), int(size[2])
    check(width, height)

    # Reading needs any variant; one that is set must stay, since Mitsuba's subclasses belong to it.
    mi = sys.modules.get("mitsuba")
    if mi is None or mi.variant() is None:
        mi = llvm.mitsuba("scalar_rgb")
    try:
        pixels = np.array(mi.Bitmap(str(path)), np.float32)
    except Exception as error:
        raise BadInput(f"{path}: truncated or damaged Radiance file; fetch or export it again.") from error
    if pixels.shape != (height, width, 3):
        raise BadInput(f"{path}: damaged Radiance file; fetch or export it again.")
    return pixels / np.float32(_exposure(path, fields))


def _exposure(path: Path, fields: bytes) -> float:
    try:
        exposure = float(np.prod([float(value) for value in re.findall(rb"^EXPOSURE=(.*)$", fields, re.MULTILINE)]))
    except ValueError:
        exposure = 0.0
    if not 0 < exposure < np.inf:
        raise BadInput(f"{path}: EXPOSURE in its header must be a positive number; mend or convert it to .exr.")
    return exposure
