"""Zonal fits beside Sloan, Luna and Snyder 2005: random vectors (figure 2), the diffuse head (figure 3), glossy."""

from __future__ import annotations

import time

import numpy as np

from benchmarks import CATALOGUE
from data_gen import materials
from envbench import harmonics
from envbench.directions import Array
from envbench.geometry import Geometry
from envbench.records import Study
from methods.ldprt import fit, glossy
from methods.ldprt.lobes import Lobes
from methods.ldprt.transfer import simulate
from methods.ldprt.visibility import spread, visible

ORDER, SEEDS = 6, 100
PRINTED_RANDOM, BARS_RANDOM = {6: 0.00908}, {4: 0.25, 5: 0.03, 6: 1e-4}
PRINTED_HEAD, BARS_HEAD = {3: 0.045}, {3: 0.06}
RAYS = 5000
PEER_VERTICES = 60
SECONDS_BAR, SPEEDUP_BAR = 15.0, 30.0


def random_vectors() -> Study:
    """Return the error by N of unit SH vectors, all coefficients drawn alike."""
    draws = np.random.default_rng(0).normal(size=(SEEDS, ORDER**2))
    vectors = draws / np.linalg.norm(draws, axis=1, keepdims=True)
    rows: list[tuple[float | int | bool | None, ...]] = []
    for count in range(1, 7):
        off = np.linalg.norm(fit.fit(vectors, count, restarts=4).vectors() - vectors, axis=1)
        median, bar = float(np.median(off)), BARS_RANDOM.get(count)
        rows.append(
            (count, median, float(off.max()), PRINTED_RANDOM.get(count), bar, None if bar is None else median <= bar)
        )
    return Study(
        "zonal-random-vectors",
        "Random SH vectors as sums of N zonal lobes, beside figure 2",
        f"RMS error of {SEEDS} random vectors of length 1, n = {ORDER}, four restarts; DC stored directly, from "
        f"three lobes "
        "on the linear part too. The paper prints one vector's error, at N = 6.",
        ("N", "median", "largest", "printed", "at most", "median within it"),
        tuple(rows),
    )


def head_fit() -> Study:
    """Return error and time by N of the head's real transfer, BFGS on some of its vertices beside it."""
    from tests.methods.ldprt import bfgs

    transfer = simulate(_head(), ORDER, rays=RAYS)
    vectors = transfer.vectors
    length = float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))
    some = np.linspace(0, len(vectors) - 1, PEER_VERTICES).astype(int)
    rows: list[tuple[str | float | bool | None, ...]] = []
    for count in (1, 2, 3, 4):
        start = time.perf_counter()
        found = fit.fit(vectors, count)
        seconds = time.perf_counter() - start
        start = time.perf_counter()
        squares = [bfgs.fit(t, count)[2] for t in vectors[some]]
        peer = (time.perf_counter() - start) / len(some)
        speedup, error = peer * len(vectors) / seconds, _rms(found, vectors) / length
        same = _rms(Lobes(found.axes[some], found.coefficients[some], found.direct[some]), vectors[some]) / length
        theirs, bar = float(np.sqrt(np.mean(squares))) / length, BARS_HEAD.get(count)
        good = None if bar is None else error <= bar
        if count == 4:
            good = seconds <= SECONDS_BAR and speedup >= SPEEDUP_BAR and same <= theirs
        rows.append((f"fitted, N = {count}", error, PRINTED_HEAD.get(count), good, seconds, speedup, same, theirs))
    for name, relative in (("optimal linear lobe", fit.optimal_linear), ("bent normal", fit.bent_normal)):
        start = time.perf_counter()
        found = relative(vectors)
        rows.append((name, _rms(found, vectors) / length, None, None, time.perf_counter() - start, None, None, None))
    better = rows[0][1] < rows[4][1]  # type: ignore[operator]
    return Study(
        "zonal-head",
        f"The diffuse head of {len(vectors):,} vertices by N, beside figure 3 and SciPy's BFGS",
        f"Its own shadowed transfer, n = {ORDER}, {RAYS} rays a vertex. RMS over the total length of all "
        f"vertices, all bands "
        "counted. BFGS: all axes and coefficients, analytic gradient (eqs. 19 to 21), greedy start, run to "
        "convergence, on "
        f"{PEER_VERTICES} of the vertices; {harmonics.threads()} threads.",
        (
            "fit",
            "error",
            "printed",
            "bars kept",
            "seconds",
            "times faster a vertex than BFGS",
            "error on its vertices",
            "BFGS",
        ),
        tuple(rows),
        (
            f"Bars: N = 3 at most {BARS_HEAD[3]:g}; N = 4 within {SECONDS_BAR:g} s, {SPEEDUP_BAR:g} times faster "
            f"than BFGS, "
            "its error not above that.",
            f"One fitted lobe is {'better' if better else 'no better'} than the optimal linear lobe.",
            f"Simulation: {transfer.seconds:.3g} s, standard error {transfer.relative_error:.2%} of the length.",
        ),
    )


def glossy_head() -> Study:
    """Return the errors of singular values left out and of the fit besides, by rows and lobes."""
    head, order, brdf = _head(), 4, materials.build({"kind": "cook-torrance", "roughness": 0.3}, "cook-torrance .3")
    mesh = head.mesh
    assert mesh is not None
    some = np.linspace(0, len(mesh.vertices) - 1, 4000).astype(int)
    directions = spread(1024)
    seen, frames = visible(head, directions)[some], glossy.frames(mesh.normals[some])
    whole = glossy.factor(brdf, order, order**2)
    vectors = glossy.specialise(whole.rows, frames, directions, seen)
    falling = ", ".join(f"{s:.2g}" for s in (whole.singular / whole.singular[0])[:10])
    rows: list[tuple[float | int, ...]] = []
    for kept, lobes in ((1, 3), (3, 1), (3, 2), (3, 3), (5, 3), (7, 3), (10, 3)):
        found = fit.fit(vectors[:, :kept].reshape(-1, order**2), lobes).vectors().reshape(-1, kept, order**2)
        errors = glossy.errors(vectors, kept, found)
        rows.append((kept, lobes, kept * lobes, errors.svd, errors.fit, float(np.hypot(errors.svd, errors.fit))))
    return Study(
        "glossy-head",
        "Cook-Torrance of roughness .3 on the head, n = 4: rows and lobes, beside figure 4",
        "RMS over 4,000 vertices, all views of the 32 x 32 map and white light, relative to the whole. Printed "
        "without "
        "numbers: n_b = 3 rows are a good approximation, N = 3 lobes a row an accurate fit.",
        ("n_b", "N", "lobes", "error of the rows left out", "further error of the fit", "both"),
        tuple(rows),
        (
            f"Singular values: {falling} ... of the first. They fall slowly, so that in this norm three rows leave "
            "much out; the fit of what is kept is accurate.",
        ),
    )  # fmt: skip


def _head() -> Geometry:
    from data_gen import geometry

    return geometry.build(CATALOGUE.geometries["head"], "head")


def _rms(lobes: Lobes, vectors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum((lobes.vectors() - vectors) ** 2, axis=1))))
