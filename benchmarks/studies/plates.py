"""Plates: labelled panels in rows, as papers print figures, in one PNG."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array
from envbench.tonemap import pictured

Pixels = NDArray[np.uint8]

GAP, LINE = 8, 15
"""Pixels between panels, and that a line of a label takes."""
PAPER, NOTHING = 255, 232
"""Grey of the plate, and of pixels of a panel where nothing is."""
_DEEP = np.array([[33, 102, 172], [247, 247, 247], [178, 24, 43]], float)
"""ColorBrewer's RdBu by its ends and middle: safe for the colour-blind."""


@dataclass(frozen=True, eq=False)
class Panel:
    """A picture (H, W, 3) with a label above it, a line or several."""

    label: str
    pixels: Pixels


def plate(rows: Sequence[Sequence[Panel]]) -> bytes:
    """Return rows of panels as a PNG; a row's panels stand side by side, from the left."""
    from PIL import Image, ImageDraw, ImageFont

    heads = [LINE * max(panel.label.count("\n") + 1 for panel in row) + 4 for row in rows]
    heights = [head + max(len(panel.pixels) for panel in row) for head, row in zip(heads, rows, strict=True)]
    width = GAP + max(sum(panel.pixels.shape[1] + GAP for panel in row) for row in rows)
    sheet = Image.new("RGB", (width, GAP + sum(height + GAP for height in heights)), (PAPER,) * 3)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(12)
    top = GAP
    for row, head, height in zip(rows, heads, heights, strict=True):
        left = GAP
        for panel in row:
            for number, line in enumerate(panel.label.split("\n")):
                draw.text((left, top + LINE * number), line, fill=(0, 0, 0), font=font)
            sheet.paste(Image.fromarray(panel.pixels), (left, top + head))
            left += panel.pixels.shape[1] + GAP
        top += height + GAP
    buffer = io.BytesIO()
    sheet.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def shown(image: NDArray[np.floating], stops: float) -> Pixels:
    """Return radiance (H, W, 3) exposed by `stops`, as `envbench.tonemap.pictured` has it; NaN is where nothing is."""
    there = np.isfinite(image).all(axis=-1, keepdims=True)
    return np.where(there, pictured(np.where(there, image, 0), stops), NOTHING).astype(np.uint8)


def signed(values: Array, limit: float) -> Pixels:
    """Return signed values (H, W) as colours, -`limit` and below blue, 0 white, `limit` and above red."""
    at = np.clip(np.nan_to_num(values) / limit, -1, 1)
    colours = np.stack([np.interp(at, [-1, 0, 1], channel) for channel in _DEEP.T], axis=-1)
    return np.where(np.isfinite(values)[..., None], np.rint(colours), NOTHING).astype(np.uint8)


TONE = (
    "Radiance is exposed so that the 99th percentile of the reference's luminance is about 1, alike for all panels of a "
    "row, clipped to [0, 1], on sRGB's curve."
)
"""What `shown` does with `envbench.tonemap.exposure`."""
