"""Images of a scene as PNG data URIs: reference, each method, and their signed difference at one fixed scale."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from envbench.records import CellResult, SceneResult
from envbench.tonemap import exposure, pictured
from reports.numerals import RADIANCE, three

PIXEL_BUDGET = 20_000_000
"""Pixels that one report shows at most; beyond, every image keeps each n-th row and column only."""
_BROKEN = (255, 0, 255)
"""Where the reference has a value and the method none: no radiance looks like this."""
_STEPS = 253
"""Colours of the difference scale, odd so that zero has its own; the palette then ends with `_BROKEN` and no point."""


@dataclass(frozen=True)
class Shot:
    """A cell's image and its difference from the reference, as data URIs; `broken` counts pixels without a value."""

    cell: CellResult
    render: str
    difference: str
    extreme: str
    broken: int


@dataclass(frozen=True)
class Gallery:
    """The images of one scene.

    Attributes
    ----------
    exposure : float
        Stops (powers of two) applied before the sRGB curve.
    limit : str
        The difference that the ends of the colour scale stand for, in `unit`.
    step : int
        Every `step`-th pixel is shown.
    """

    index: int
    scene: SceneResult
    reference: str
    exposure: float
    limit: str
    unit: str
    step: int
    shots: tuple[Shot, ...]


def thinning(images: Sequence[NDArray[np.float32] | None]) -> int:
    """Return the step between shown pixels that keeps a report of these images within `PIXEL_BUDGET`."""
    # Each image is shown twice, as it is and as a difference.
    pixels = sum(2 * image.shape[0] * image.shape[1] for image in images if image is not None)
    return max(1, math.ceil(math.sqrt(pixels / PIXEL_BUDGET)))


def gallery(index: int, scene: SceneResult, cells: Sequence[CellResult], step: int) -> Gallery | None:
    """Return the images of `scene`, the run's `index`-th, or None where its points form none."""
    if scene.image is None or scene.image.size == 0:
        return None
    reference = scene.image[::step, ::step]
    relative = scene.reference_rms > 0
    scale = 1 / scene.reference_rms if relative else 1.0
    shown = [(cell, cell.image[::step, ::step]) for cell in cells if cell.image is not None]
    shown = [(cell, image) for cell, image in shown if image.shape == reference.shape]
    differences = [_mean_difference(image, reference) * scale for _, image in shown]
    limit, stops = _limit(differences), exposure(reference[_finite(reference)])
    covered = _finite(reference)
    unit = "% of the reference's RMS radiance" if relative else f"{RADIANCE} (the reference is black)"
    percent = 100 if relative else 1
    shots = tuple(
        Shot(
            cell,
            _render(image, covered, stops),
            _signed(difference, covered, limit),
            _extreme(difference, percent, "%" if relative else ""),
            int((covered & ~_finite(image)).sum()),
        )
        for (cell, image), difference in zip(shown, differences, strict=True)
    )
    return Gallery(index, scene, _render(reference, covered, stops), stops, f"{percent * limit:g}", unit, step, shots)


def colour_bar() -> str:
    """Return the difference scale as a CSS gradient, from too dark to too bright."""
    colours = ", ".join(f"rgb({r} {g} {b})" for r, g, b in _diverging(11).tolist())
    return f"linear-gradient(to right, {colours})"


def _finite(image: NDArray[np.float32]) -> NDArray[np.bool_]:
    return np.logical_and.reduce(np.isfinite(image), axis=-1)


def _mean_difference(image: NDArray[np.float32], reference: NDArray[np.float32]) -> NDArray[np.float64]:
    return (image.astype(np.float64) - reference).mean(-1)


def _limit(differences: Sequence[NDArray[np.float64]]) -> float:
    """Choose the scale's end: the 1-2-5 step above the middle method's 99th percentile.

    The worst method would turn all others white; the best one would saturate them all.
    """
    finite = [np.abs(difference[np.isfinite(difference)]) for difference in differences]
    high = float(np.median([np.percentile(values, 99) for values in finite if values.size] or [0.0]))
    if not high > 0:
        return 0.01
    decade = 10.0 ** math.floor(math.log10(high))
    return next(step * decade for step in (1, 2, 5, 10) if step * decade >= high * (1 - 1e-9))


def _render(image: NDArray[np.float32], covered: NDArray[np.bool_], stops: float) -> str:
    """Encode exposure, clipping to [0, 1] and the sRGB curve (IEC 61966-2-1); no point is transparent."""
    finite = _finite(image)
    pixels = np.zeros((*finite.shape, 4), np.uint8)
    pixels[..., :3] = pictured(np.where(finite[..., None], image, 0), stops)
    pixels[..., 3] = 255 * covered
    pixels[covered & ~finite] = (*_BROKEN, 255)
    return _png(pixels)


def _signed(difference: NDArray[np.float64], covered: NDArray[np.bool_], limit: float) -> str:
    """Encode a signed difference: `-limit` and below is the first colour, `limit` and above the last."""
    unit = np.clip(np.nan_to_num(difference, posinf=0, neginf=0) / limit, -1, 1)
    index = np.rint((unit + 1) / 2 * (_STEPS - 1)).astype(np.uint8)
    index[covered & ~np.isfinite(difference)] = _STEPS
    index[~covered] = _STEPS + 1
    palette = np.vstack([_diverging(_STEPS), _BROKEN, (128, 128, 128)]).astype(np.uint8)
    return _png(index, palette)


def _extreme(difference: NDArray[np.float64], factor: float, unit: str) -> str:
    finite = difference[np.isfinite(difference)]
    return (
        f"{three(factor * float(finite.min()))} … {three(factor * float(finite.max()))} {unit}" if finite.size else ""
    )


def _diverging(count: int) -> NDArray[np.uint8]:
    """Return ColorBrewer's RdBu, safe for the colour-blind, from blue (too dark) to red (too bright), (count, 3)."""
    from plotly.colors import diverging, unlabel_rgb

    anchors = np.array([unlabel_rgb(colour) for colour in reversed(diverging.RdBu)])
    at = np.linspace(0, len(anchors) - 1, count)
    return np.rint(
        np.stack([np.interp(at, np.arange(len(anchors)), channel) for channel in anchors.T], axis=-1)
    ).astype(np.uint8)


def _png(pixels: NDArray[np.uint8], palette: NDArray[np.uint8] | None = None) -> str:
    """Encode (H, W, 4) colours, or (H, W) indices into a palette whose last entry is transparent."""
    from PIL import Image

    picture = Image.fromarray(pixels)
    buffer = io.BytesIO()
    if palette is None:
        picture.save(buffer, "PNG")
    else:
        picture.putpalette(palette.tobytes())
        picture.save(buffer, "PNG", transparency=len(palette) - 1)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
