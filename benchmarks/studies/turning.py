"""Turning and shading: products of an SH rotation, the thin membrane, the light's table, frames a second."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from data_gen import environments
from envbench import harmonics, real_harmonics
from envbench.directions import uniform
from envbench.records import Study
from methods.ldprt import fit, membrane, rotation, shade, table

PRINTED = {3: 53, 4: 121, 5: 217, 6: 345, 7: 509, 8: 713, 9: 961}
"""Products of a rotation by zxzxz (Sloan, Luna and Snyder 2005, sec. 3.4)."""
EXACT = 1e-12
HEAD, HZ = 17575, 200.0


def sh_rotation() -> Study:
    """Return the products that the loops take, and how far a rotation is from the function turned."""
    rows: list[tuple[float | int | bool | None, ...]] = []
    rng = np.random.default_rng(0)
    matrices = Rotation.random(20, rng=np.random.default_rng(1)).as_matrix()
    for n in (*PRINTED, 16, 31):
        vectors = rng.normal(size=(20, n * n))
        turned = rotation.rotate(vectors, matrices)
        at = uniform(400, rng)
        off = 0.0
        for t, v, R in zip(turned, vectors, matrices, strict=True):
            before, after = v @ real_harmonics.basis(n - 1, at @ R), t @ real_harmonics.basis(n - 1, at)
            off = max(off, float(np.abs(after - before).max() / np.sqrt(np.mean(before**2))))
        count, printed = rotation.multiplies(n), PRINTED.get(n)
        rows.append((n, count, printed, None if printed is None else count == printed, off, off <= EXACT * n))
    return Study(
        "sh-rotation",
        "SH rotation by zxzxz: products, and exactness",
        "Products counted by the loops that rotate, beside the printed ones; those that meet an entry that "
        "happens to be zero "
        f"count. Exactness: 20 random vectors and rotations, the function turned against turned coefficients at "
        f"400 directions, "
        f"over its RMS (the tests hold every band to {EXACT:g} against Wigner matrices).",
        ("n", "products", "printed", "equal", "largest difference", f"within {EXACT:g} n"),
        tuple(rows),
    )


def thin_membrane() -> Study:
    """Return eq. 23 against its integral, and what constant light returns."""
    x, w = np.polynomial.legendre.leggauss(64)
    z, w = np.concatenate([(x + 1) / 2, -(x + 1) / 2]), np.concatenate([w, w]) / 2
    rows: list[tuple[float | int | bool, ...]] = []
    for alpha in (0.0, 0.3, 1.0):
        for n in (3, 6, 20):
            found = membrane.coefficients(n, alpha)
            numeric = 2 * (w * np.where(z > 0, z, -alpha * z)) @ np.polynomial.legendre.legvander(z, n - 1)
            off = float(np.abs(found - numeric).max())
            rows.append((alpha, n, off, off <= EXACT, float(found[0]), bool(abs(found[0] - 1 - alpha) <= EXACT)))
    return Study(
        "thin-membrane",
        "The thin membrane's coefficients in closed form",
        "Eq. 23, the division by pi included, against the integral of eq. 22 by Gauss's rule; and what constant "
        "light of "
        "radiance 1 returns, which is 1 + alpha.",
        ("alpha", "n", "largest difference", f"within {EXACT:g}", "under constant light", "is 1 + alpha"),
        tuple(rows),
    )


def shading() -> Study:
    """Return time, rate and error of each way to shade a head's worth of points."""
    n, rng = 6, np.random.default_rng(0)
    vectors = membrane.transfer(uniform(HEAD, rng), n) * rng.uniform(0.2, 1, (HEAD, n * n))
    light = real_harmonics.project(environments.build({"kind": "captured", "name": "studio"}).radiance, n - 1)
    turns = Rotation.random(HEAD, rng=np.random.default_rng(2)).as_matrix()
    rows: list[tuple[str | float | bool | None, ...]] = []
    exact = shade.full(vectors, light, turns)
    for count in (1, 4):
        found = fit.fit(vectors, count, restarts=0)
        packed = shade.pack(found.axes, found.coefficients, found.direct)
        direct = shade.evaluated(packed, light, turns)
        g = np.abs(packed.coefficients).sum(0)  # (n - b, V)
        bound = np.einsum("lv,lc->vc", g, table.largest_error(light)[packed.first :])

        def by_table(packed: Any = packed) -> Any:
            return shade.specialised(packed, light, table.build(light, n), turns)

        def evaluated(packed: Any = packed) -> Any:
            return shade.evaluated(packed, light, turns)

        off = np.abs(by_table() - direct)
        rows.append(
            (
                f"N = {count}, table made anew (eq. 25)",
                *_timed(by_table, evaluated),
                _nrmse(by_table(), direct),
                bool((off <= bound + 1e-4).all()),
            )
        )
        rows.append((f"N = {count}, evaluated (eq. 13)", *_timed(evaluated, evaluated), None, None))
    full = _timed(lambda: shade.full(vectors, light, turns, shade.Turning.TRANSFER), evaluated)
    rows.append(
        (
            "full SH rotation, transfer turned",
            *full,
            _nrmse(shade.full(vectors, light, turns, shade.Turning.TRANSFER), exact),
            None,
        )
    )
    rows.append(
        ("full SH rotation, light turned", *_timed(lambda: shade.full(vectors, light, turns), evaluated), None, None)
    )
    rows.append(("no rotation (static)", *_timed(lambda: shade.static(vectors, light), evaluated), None, None))
    rows.append(("the table alone", *_timed(lambda: table.build(light, n), evaluated, points=False), None, None))
    return Study(
        "shading",
        f"Shading {HEAD:,} points under the studio, n = 6, three channels",
        f"Medians of 15 rounds in turns with N = 4 evaluated, {harmonics.threads()} threads, states in memory; "
        f"every point turned by a "
        "rotation of its own. Error: of the table against eq. 13, RMS; and whether every point lies within the "
        "bound stated for "
        "interpolation in the table. The paper: 100 to 200 Hz on graphics hardware of 2005, the table alone at "
        "1430 Hz.",
        ("way", "ms", "Hz", f"above {HZ:g} Hz", "million points/s", "time over N = 4 evaluated", "error", "in bound"),
        tuple(rows),
        ("On a processor with wide vectors a lookup costs more than the arithmetic that it saves: the table, "
         "made for graphics "
         "hardware, is the slower way here.",),
    )  # fmt: skip


def _timed(run: Callable[[], Any], peer: Callable[[], Any], points: bool = True) -> tuple[float | bool | None, ...]:
    run()
    peer()
    seconds = np.array([(_seconds(run), _seconds(peer)) for _ in range(15)])
    median = float(np.median(seconds[:, 0]))
    ratio = float(np.median(seconds[:, 0] / seconds[:, 1]))
    return 1e3 * median, 1 / median, 1 / median > HZ, HEAD / median / 1e6 if points else None, ratio


def _seconds(run: Callable[[], Any]) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def _nrmse(found: Any, exact: Any) -> float:
    return float(np.sqrt(np.mean((found - exact) ** 2) / np.mean(exact**2)))
