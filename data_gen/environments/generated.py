"""Lights with a formula: constant, one pixel, noise, spherical Gaussian lamps, random band-limited."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from data_gen.environments import parameters as p
from envbench import directions, latlong
from envbench.directions import Array
from envbench.environment import Environment
from envbench.errors import BadInput


def constant(*, radiance: Any = 1.0, size: int = 16) -> Environment:
    """Return the same radiance from everywhere: a number or (r, g, b); `size` rows."""
    height = p.integer("constant", "size", size, 2, p.MAX_ROWS)
    values = np.broadcast_to(p.colour("constant", "radiance", radiance), (height, 2 * height, 3))
    return Environment("constant", values.astype(np.float32))


def pixel(*, row: int = 0, column: int = 0, radiance: Any = 1e8, size: int = 64) -> Environment:
    """Return black with one lit pixel of a map of `size` rows: a tent, from zero to zero over two pixels each way."""
    height = p.integer("pixel", "size", size, 2, p.MAX_ROWS)
    row = p.integer("pixel", "row", row, 0, height - 1)
    column = p.integer("pixel", "column", column, 0, 2 * height - 1)
    values = np.zeros((height, 2 * height, 3), np.float32)
    values[row, column] = p.colour("pixel", "radiance", radiance)
    return Environment("pixel", values)


def noise(*, size: int | Sequence[int] = 64, seed: int = 0) -> Environment:
    """Return independent pixels, uniform in [0, 1): detail to the last; `size` is rows, or [columns, rows]."""
    match size:
        case [width, height]:
            pass
        case int():
            width, height = 2 * size, size
        case _:
            raise BadInput(f"The 'size' of light 'noise' must be an int or [columns, rows]. Got {size!r} instead.")
    shape = (p.integer("noise", "size", height, 2, p.MAX_ROWS), p.integer("noise", "size", width, 4, 2 * p.MAX_ROWS), 3)
    rng = np.random.default_rng(p.integer("noise", "seed", seed, 0, 2**63))
    return Environment("noise", rng.random(shape, np.float32))


def lamps(
    *, lamps: Sequence[Mapping[str, Any]] | None = None, count: int = 3, seed: int = 0, size: int = 128
) -> Environment:
    """Return a sum of spherical Gaussians, L(w) = sum_k radiance_k exp((w . direction_k - 1) / width_k^2).

    Parameters
    ----------
    lamps : sequence of mappings, optional
        Each with `direction` (3 numbers), `width` (radians: near the axis a Gaussian of this standard deviation) and
        `radiance` at the peak (a number or three).
    count, seed : int
        Without `lamps`: so many drawn at random, of widths .05 to .5 and equal power on average.
    size : int
        Rows of the map.
    """
    height = p.integer("lamps", "size", size, 2, p.MAX_ROWS)
    if not isinstance(lamps, list | tuple | None):
        raise BadInput(f"The 'lamps' of light 'lamps' must be a list. Got {lamps!r} instead.")
    if lamps is None:
        chosen = _random_lamps(p.integer("lamps", "count", count, 1, 1000), p.integer("lamps", "seed", seed, 0, 2**63))
    else:
        chosen = [_lamp(lamp) for lamp in lamps]
    where = latlong.grid(height, 2 * height)
    radiance = np.zeros(where.shape)
    for axis, width, peak in chosen:
        radiance += np.exp((where @ axis - 1) / width**2)[..., None] * peak
    pixel = np.pi / height
    narrow = [width for _, width, _ in chosen if width < 2 * pixel]
    notes = [f"{len(narrow)} lamps are narrower than two pixels ({pixel:.3g} rad each): raise size"] if narrow else []
    return Environment("lamps", radiance.astype(np.float32), tuple(notes))


def _lamp(lamp: Any) -> tuple[Array, float, Array]:
    if not isinstance(lamp, Mapping) or set(lamp) != {"direction", "width", "radiance"}:  # pyright: ignore[reportUnknownArgumentType]
        raise BadInput(f"Each of the 'lamps' of light 'lamps' has direction, width and radiance. Got {lamp!r} instead.")
    return (
        p.direction("lamps", "direction", lamp["direction"]),
        p.number("lamps", "width", lamp["width"], 1e-3, 10),
        p.colour("lamps", "radiance", lamp["radiance"]),
    )


def _random_lamps(count: int, seed: int) -> list[tuple[Array, float, Array]]:
    rng = np.random.default_rng(seed)
    axes = directions.uniform(count, rng)
    widths = np.exp(rng.uniform(np.log(0.05), np.log(0.5), count))
    # The integral over the sphere is 2 pi width^2 (1 - exp(-2 / width^2)) times the peak.
    power = 2 * np.pi * widths**2 * (1 - np.exp(-2 / widths**2))
    peaks = rng.uniform(0.5, 1.5, (count, 3)) / power[:, None]
    return list(zip(axes, widths.tolist(), peaks, strict=True))


def band_limited(*, order: int = 12, seed: int = 0, size: int = 128) -> Environment:
    """Return random light with no spherical harmonics above `order`, lifted until its darkest sample is 0.

    Coefficients are Gaussian, their standard deviation proportional to 1 / (l + 1) and the same for every m; the
    channels are correlated by a half. At the samples it is band-limited to float32; between them it is the bilinear
    interpolant, as any map.
    """
    height = p.integer("band-limited", "size", size, 2, p.MAX_ROWS)
    order = p.integer("band-limited", "order", order, 1, 1000)
    rng = np.random.default_rng(p.integer("band-limited", "seed", seed, 0, 2**63))
    if height <= order:
        raise BadInput(f"The 'size' of light 'band-limited' must be > its order {order}. Got {height} instead.")
    import ducc0

    bands = np.concatenate([np.arange(m, order + 1) for m in range(order + 1)])
    real, imaginary = rng.normal(size=(2, 4, bands.size)) / (bands + 1)
    imaginary[:, : order + 1] = 0  # m = 0
    real[:, : order + 1] *= np.sqrt(2)
    drawn = real + 1j * imaginary
    light = (drawn[:3] + drawn[3]) / np.sqrt(2)
    channels = [
        ducc0.sht.synthesis_2d(
            alm=alm[None], spin=0, lmax=order, geometry="F1", ntheta=height, nphi=2 * height,
            phi0=np.pi / (2 * height), nthreads=1,
        )[0]
        for alm in light
    ]  # fmt: skip
    radiance = np.stack(channels, axis=-1)
    radiance -= radiance.min(axis=(0, 1))
    return Environment("band-limited", radiance.astype(np.float32))
