"""Contact sheets: a study's images laid out in a grid with their labels, as a paper prints a figure, in one PNG.

A study makes tiles of radiance (`exposed`, all of a sheet at the same stops), of signed differences (`signed`, all at
the same limit, with the sheet's `Scale`) or of numbers on a map's texels, and lays them out with `compose`:

    stops = exposure(reference[finite])                          # envbench.tonemap
    scale = Scale(round_limit(differences), "RMS radiances")
    png = compose(
        [[Tile(exposed(a, stops), "P = 0")], [Tile(signed(a - truth, scale.limit), "NRMSE 23 %")]],
        columns=["view 1"], labels=["image", "difference"], notes=[toned(stops)], scale=scale,
    )

White is where a picture of radiance has no point, mid grey where a difference has none.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.tonemap import pictured

Pixels = NDArray[np.uint8]

NO_POINT, NO_DIFFERENCE, BROKEN = (255, 255, 255), (128, 128, 128), (255, 0, 255)
"""Where there is no point, in pictures and in differences; and what is neither finite nor left out."""
TEXT, GAP, MARGIN, LABEL = 14, 8, 14, 118
"""Size of the text, space between tiles, around all, and the width of the rows' labels, in pixels."""
_INK, _PAPER = (32, 32, 32), (255, 255, 255)


@dataclass(frozen=True)
class Tile:
    """A picture (H, W, 3) with a caption beneath, which is wrapped to its width."""

    pixels: Pixels
    caption: str = ""


@dataclass(frozen=True)
class Scale:
    """What the colours of differences mean: blue is `limit` too dark or darker, red `limit` too bright or brighter."""

    limit: float
    unit: str


@dataclass(frozen=True)
class Border:
    """A line drawn between tiles through `corners` (row, column), each the one above and left of the tile there."""

    corners: tuple[tuple[int, int], ...]
    colour: tuple[int, int, int] = (222, 166, 0)


def exposed(image: NDArray[np.floating], stops: float) -> Pixels:
    """Return radiance (H, W, 3), NaN where there is no point, as colours: exposed, clipped, on sRGB's curve."""
    empty = np.logical_and.reduce(np.isnan(image), axis=-1)
    finite = np.logical_and.reduce(np.isfinite(image), axis=-1)
    out = pictured(np.where(finite[..., None], image, 0.0), stops)
    out[~finite] = BROKEN
    out[empty] = NO_POINT
    return out


def toned(stops: float) -> str:
    """Say how `exposed` made colours of radiance."""
    return f"Linear radiance, exposed by {stops:+g} stops, clipped, sRGB curve."


def signed(difference: NDArray[np.floating], limit: float) -> Pixels:
    """Return the mean over the channels of a difference (H, W, 3) as colours between -`limit` and `limit`."""
    mean = difference.mean(-1)
    out = _diverging(np.clip(np.nan_to_num(mean) / limit, -1, 1))
    out[~np.isfinite(mean)] = BROKEN
    out[np.isnan(mean)] = NO_DIFFERENCE
    return out


def round_limit(differences: Sequence[NDArray[np.floating]]) -> float:
    """Return a scale's end for differences (H, W, 3): the 1-2-5 step above the middle one's 99th percentile.

    The worst would turn all others white, and the best would saturate them all.
    """
    high = float(np.median([np.nanpercentile(np.abs(d.mean(-1)), 99) for d in differences]))
    if not high > 0:
        return 0.01
    decade = 10.0 ** math.floor(math.log10(high))
    return next(step * decade for step in (1, 2, 5, 10) if step * decade >= high * (1 - 1e-9))


def percent(value: float) -> str:
    """Return a share as text of three digits that no line break parts.

    Examples
    --------
    >>> percent(0.05678).replace("\xa0", " ")
    '5.68 %'
    """
    return f"{100 * value:.3g}\xa0%"


def enlarged(pixels: Pixels, size: int) -> Pixels:
    """Return a picture at the whole multiple of its size that comes nearest to `size` pixels across, or as it is."""
    times = max(round(size / pixels.shape[1]), 1)
    return pixels.repeat(times, 0).repeat(times, 1)


def compose(
    rows: Sequence[Sequence[Tile | None]],
    *,
    columns: Sequence[str] = (),
    labels: Sequence[str] = (),
    notes: Sequence[str] = (),
    scale: Scale | None = None,
    borders: Sequence[Border] = (),
) -> bytes:
    """Lay tiles out and return the PNG, the same bytes for the same pixels.

    Parameters
    ----------
    rows : rows of tiles
        None leaves a place empty. A column is as wide as its widest tile.
    columns, labels : sequence of str
        Above the columns, and left of the rows.
    notes : sequence of str
        Below all, e.g. how radiance became colours.
    scale : Scale, optional
        Drawn as a bar, where some tiles are differences.
    borders : sequence of Border
        For sheets without captions.
    """
    from PIL import Image, ImageDraw, ImageFont

    font: Any = ImageFont.load_default(size=TEXT)
    count = max(len(row) for row in rows)
    tiles = [(i, tile.pixels.shape[1]) for row in rows for i, tile in enumerate(row) if tile]
    width = [max((wide for j, wide in tiles if j == i), default=0) for i in range(count)]
    left = MARGIN + (LABEL if labels else 0)
    across = [left + sum(width[:i]) + i * GAP for i in range(count + 1)]
    heads = [_wrapped(font, text, w) for text, w in zip(columns, width, strict=False)]
    captions = [[_wrapped(font, t.caption, width[i]) if t else [] for i, t in enumerate(row)] for row in rows]
    line = TEXT + 4
    y = MARGIN + line * max((len(head) for head in heads), default=0) + (4 if heads else 0)
    tops: list[int] = []
    for row, under in zip(rows, captions, strict=True):
        tops.append(y)
        y += max(t.pixels.shape[0] for t in row if t) + line * max(map(len, under)) + GAP
    total = max(across[-1] - GAP + MARGIN, 440)
    said = [f"Differences, channels averaged, in {scale.unit}.", *notes] if scale else notes
    feet = [text for note in said for text in _wrapped(font, note, total - 2 * MARGIN)]
    foot = y + (2 * line + 8 if scale else 0)
    sheet = Image.new("RGB", (total, foot + line * len(feet) + MARGIN - GAP), _PAPER)
    draw: Any = ImageDraw.Draw(sheet)

    def write(lines: Sequence[str], x: float, top: float, anchor: str = "ma") -> None:
        for number, text in enumerate(lines):
            draw.text((x, top + number * line), text, _INK, font=font, anchor=anchor)

    for i, head in enumerate(heads):
        write(head, across[i] + width[i] / 2, MARGIN)
    for number, row in enumerate(rows):
        if number < len(labels):
            write(_wrapped(font, labels[number], LABEL - GAP), MARGIN, tops[number] + 2, "la")
        for i, tile in enumerate(row):
            if tile:
                at = across[i] + (width[i] - tile.pixels.shape[1]) // 2
                sheet.paste(Image.fromarray(tile.pixels), (at, tops[number]))
                write(captions[number][i], across[i] + width[i] / 2, tops[number] + tile.pixels.shape[0] + 2)
    down = [*tops, y]
    for border in borders:
        line_of = [(across[column] - GAP / 2, down[row] - GAP / 2) for row, column in border.corners]
        draw.line(line_of, fill=border.colour, width=3, joint="curve")
    if scale:
        _bar(sheet, draw, font, scale, (MARGIN, y))
    write(feet, MARGIN, foot, "la")
    buffer = io.BytesIO()
    sheet.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def _bar(sheet: Any, draw: Any, font: Any, scale: Scale, at: tuple[int, int]) -> None:
    from PIL import Image

    x, y = at[0] + 60, at[1]
    length = 260
    ramp = _diverging(np.linspace(-1, 1, length))[None].repeat(TEXT, 0)
    sheet.paste(Image.fromarray(ramp), (x, y))
    draw.rectangle((x - 1, y - 1, x + length, y + TEXT), outline=_INK)
    for place, value in ((x, -scale.limit), (x + length // 2, 0.0), (x + length, scale.limit)):
        draw.text((place, y + TEXT + 3), f"{value:g}" if value <= 0 else f"+{value:g}", _INK, font=font, anchor="ma")


def _wrapped(font: Any, text: str, width: int) -> list[str]:
    """Break text into lines of at most `width` pixels, at spaces and where it says."""
    lines: list[str] = []
    for part in text.split("\n") if text else []:
        lines.append("")
        for word in part.split(" "):
            longer = f"{lines[-1]} {word}".strip()
            if font.getlength(longer) <= width or not lines[-1]:
                lines[-1] = longer
            else:
                lines.append(word)
    return [text.replace("\xa0", " ") for text in lines]  # the font has no glyph for it


def _diverging(value: NDArray[np.floating]) -> Pixels:
    """Return ColorBrewer's RdBu at values in [-1, 1], from blue (too dark) over white to red (too bright)."""
    from plotly.colors import diverging, unlabel_rgb

    anchors = np.array([unlabel_rgb(colour) for colour in reversed(diverging.RdBu)])
    at = (value + 1) / 2 * (len(anchors) - 1)
    channels = [np.interp(at, np.arange(len(anchors)), channel) for channel in anchors.T]
    return np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
