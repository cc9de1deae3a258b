"""Samples that explicit maps need for their orders: RH 2002, sec. 5.2, S ~ 10 F and T ~ 10 P."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.studies.prefiltering import light
from data_gen.lobes import Phong
from envbench import harmonics, latlong
from envbench.directions import Array, from_angles, to_angles, uniform
from envbench.material import Centre
from envbench.real_harmonics import basis
from envbench.records import Study
from methods.shrm import explicit, maps
from methods.shrm.coefficients import expand

ORDERS = (5, 10, 20, 40)
VIEW_ORDERS = (2, 4, 8)
LEVELS = (0.03, 0.01, 0.003)
"""Errors of bilinear lookup, RMS over the RMS of the map."""
POINTS, FUNCTIONS = 4000, 64


def samples_per_order() -> Study:
    """Return the least S and T at which bilinear lookup errs by at most a level, over F and P."""
    rng = np.random.default_rng(0)
    at = uniform(POINTS, rng)
    rows: list[tuple[str | float | int | None, ...]] = []
    for F in ORDERS:
        read, exact = _map(F, at)
        rows += [("S", F, level, *_least(read, exact, level, F)) for level in LEVELS]
    for P in VIEW_ORDERS:
        read, exact = _views(P, at)
        rows += [("T", P, level, *_least(read, exact, level, P)) for level in LEVELS]
    return Study(
        "samples-per-order",
        "Samples that bilinear lookup needs, over the orders F and P",
        f"Least S at which a map of S x 2 S texels, looked up bilinearly at {POINTS:,} uniform directions, errs by at "
        "most a level (RMS over RMS): Phong lobes whose F leaves out .01, under the studio. Least T alike, of T x T "
        f"view directions, for {FUNCTIONS} functions of the view with random coefficients of equal power up to P.",
        ("of", "order", "level", "samples", "samples over order"),
        tuple(rows),
    )


def _map(F: int, at: Array) -> tuple[Callable[[int], Array], Array]:
    kept = expand(Phong(exponent=F**2 / -np.log(0.01), clipped=False), 0.01, F, 0)
    alm = maps.products(kept, harmonics.analyse(light(128, 256), F))[:, 0]
    exact = harmonics.synthesise_at(alm, F, np.stack(to_angles(at), -1), 1e-6).T

    def read(samples: int) -> Array:
        out = np.empty((3, samples, 2 * samples), alm.real.dtype)
        for channel in range(3):
            harmonics.synthesise(alm[channel : channel + 1], 0, F, out[channel : channel + 1])
        return latlong.interpolate(np.moveaxis(out, 0, 2), at)

    return read, np.asarray(exact, float)


def _views(P: int, at: Array) -> tuple[Callable[[int], Array], Array]:
    coefficients = np.random.default_rng(P).normal(size=((P + 1) ** 2, FUNCTIONS))
    theta, phi = to_angles(at)

    def seen(views: Array) -> Array:
        return basis(P, views).T @ coefficients

    def read(samples: int) -> Array:
        polar = explicit.polar_nodes(Centre.REFLECTION, samples)
        azimuth = 2 * np.pi * np.arange(samples) / samples
        nodes = seen(from_angles(polar[:, None], azimuth).reshape(-1, 3)).reshape(samples, samples, -1)
        y, x = theta / polar[1], phi / azimuth[1]
        i, j = np.minimum(y.astype(int), samples - 2), x.astype(int) % samples
        fy, fx = (y - i)[:, None], (x - np.floor(x))[:, None]
        right = (j + 1) % samples
        top = nodes[i, j] * (1 - fx) + nodes[i, right] * fx
        return top * (1 - fy) + (nodes[i + 1, j] * (1 - fx) + nodes[i + 1, right] * fx) * fy

    return read, seen(at)


def _least(read: Callable[[int], Array], exact: Array, level: float, order: int) -> tuple[int | None, float | None]:
    """Return the least even number of samples at which the error is at most `level`; it falls with their number."""
    power = np.sqrt(np.mean(exact**2))

    def well(half: int) -> bool:
        return bool(np.sqrt(np.mean((read(2 * half) - exact) ** 2)) <= level * power)

    low, high = 1, 2 * order
    while not well(high):
        low, high = high, 2 * high
        if high > 50 * order:
            return None, None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if well(middle) else (middle, high)
    return 2 * high, 2 * high / order
