"""Zonal fits beside Sloan, Luna and Snyder 2005: random vectors (figure 2), the diffuse head (figure 3), glossy."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import CATALOGUE
from benchmarks.studies.contact_sheet import Scale, Tile, compose, exposed, signed, toned
from benchmarks.studies.glyphs import glyph
from data_gen import environments, materials
from envbench import harmonics
from envbench.catalogue import Spec
from envbench.directions import Array, uniform
from envbench.geometry import Points
from envbench.real_harmonics import basis, project
from envbench.records import Picture, Study
from envbench.scene import Scene
from envbench.tonemap import exposure
from methods.ldprt import fit, glossy
from methods.ldprt.corners import Corners
from methods.ldprt.lobes import Lobes
from methods.ldprt.simulated import SIMULATIONS, Request
from methods.ldprt.transfer import Kind
from methods.ldprt.visibility import spread, visible

ORDER, SEEDS = 6, 100
PRINTED_RANDOM, BARS_RANDOM = {6: 0.00908}, {4: 0.25, 5: 0.03, 6: 1e-4}
PRINTED_HEAD, BARS_HEAD = {3: 0.045}, {3: 0.06}
RAYS = 5000
GLYPH = 150
"""Pixels a side of a function that is drawn."""
HEAD_LIGHT, GLOSSY_LIGHT = "studio-6", {"kind": "projected", "of": "studio", "order": 4}
GLOSSY = "Cook-Torrance .3"
GOOD, ACCURATE = 0.1, 0.05
"""What is taken for the paper's "good approximation" and "accurate fit", which it gives no numbers for."""
OTHERS: dict[str, dict[str, Any]] = {
    "Cook-Torrance 1": {"kind": "cook-torrance", "roughness": 1.0},
    "Cook-Torrance .3 on a diffuse base of .5": {
        "lobes": [
            {"kind": "lambertian", "reflectance": [0.5, 0.5, 0.5]},
            {"kind": "cook-torrance", "roughness": 0.3},
        ]
    },
}
"""BRDFs whose singular values stand beside it: the paper does not say what its glossiness means, or what lies below."""
PEER_VERTICES = 60
SECONDS_BAR, SPEEDUP_BAR = 15.0, 30.0


def random_vectors() -> Study:
    """Return the error by N of unit SH vectors, all coefficients drawn alike."""
    draws = np.random.default_rng(0).normal(size=(SEEDS, ORDER**2))
    vectors = draws / np.linalg.norm(draws, axis=1, keepdims=True)
    rows: list[tuple[float | int | bool | None, ...]] = []
    drawn: dict[int, Lobes] = {}
    for count in range(1, 7):
        found = fit.fit(vectors, count, restarts=4)
        off = np.linalg.norm(found.vectors() - vectors, axis=1)
        drawn[count] = Lobes(found.axes[:1], found.coefficients[:1], found.direct[:1])
        median, bar = float(np.median(off)), BARS_RANDOM.get(count)
        rows.append(
            (count, median, float(off.max()), float(off[0]), PRINTED_RANDOM.get(count), bar,
             None if bar is None else median <= bar)
        )  # fmt: skip
    return Study(
        "zonal-random-vectors",
        "Random SH vectors as sums of N zonal lobes, beside figure 2",
        f"RMS error of {SEEDS} random vectors of length 1, n = {ORDER}, four restarts; DC stored directly, from "
        f"three lobes "
        "on the linear part too. The paper prints one vector's error, at N = 6.",
        ("N", "median", "largest", "of the one drawn", "printed", "at most", "median within it"),
        tuple(rows),
        pictures=(_lobes_drawn(vectors[0], drawn),),
    )


def _lobes_drawn(vector: Array, found: dict[int, Lobes]) -> Picture:
    """Draw a vector, its sums of lobes, and what the four of N = 4 and the direct part are."""
    four = found[4]
    parts = {"N = 4: DC and linear": Lobes(four.axes, 0 * four.coefficients, four.direct).vectors()[0]}
    for i in range(4):
        one = slice(i, i + 1)
        parts[f"lobe {i + 1}"] = Lobes(four.axes[:, one], four.coefficients[:, one], 0 * four.direct).vectors()[0]
    whole = {"the vector": vector}
    for count, lobes in found.items():
        sum_of = lobes.vectors()[0]
        whole[f"N = {count}: RMS {np.linalg.norm(sum_of - vector):.3g}"] = sum_of
    y = basis(ORDER - 1, uniform(20_000, np.random.default_rng(1)))
    reach = 1.05 * max(float(np.abs(f @ y).max()) for f in (*whole.values(), *parts.values()))
    sums, lower = ([Tile(glyph(f, reach, GLYPH), name) for name, f in some.items()] for some in (whole, parts))
    note = "Distance from the middle: |f(s)|, at one scale; red positive, blue negative."
    return Picture(
        "lobes",
        "The first of the vectors, its sums of N lobes, and the parts of the sum of four.",
        compose([sums[:4], sums[4:], lower], notes=(note,)),
    )


def head_fit(shape: Spec | None = None) -> Study:
    """Return error and time by N of the head's real transfer, or another's, BFGS on some of its vertices beside it."""
    from tests.methods.ldprt import bfgs

    transfer = SIMULATIONS.get(_seen(shape, HEAD_LIGHT).geometry, Request(ORDER, Kind.SHADOWED, RAYS, 0, 1.0, 0))
    vectors = transfer.vectors
    length = float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))
    some = np.linspace(0, len(vectors) - 1, PEER_VERTICES).astype(int)
    rows: list[tuple[str | float | bool | None, ...]] = []
    seen: dict[str, Array] = {}
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
        seen[f"N = {count}: RMS {error:.3f}"] = found.vectors()
        rows.append(("fitted", count, error, PRINTED_HEAD.get(count), good, seconds, speedup, same, theirs))
    for name, relative in (("optimal linear lobe", fit.optimal_linear), ("bent normal", fit.bent_normal)):
        start = time.perf_counter()
        found = relative(vectors)
        seconds, error = time.perf_counter() - start, _rms(found, vectors) / length
        seen[f"{name}: RMS {error:.3f}"] = found.vectors()
        better = float(rows[0][2] or 0) < error
        rows.append((name, None, error, None, better, seconds, None, None, None))
    return Study(
        "zonal-head" if shape is None else "zonal-patch",
        f"A diffuse {_named(shape)} of {len(vectors):,} vertices by N, beside figure 3 and SciPy's BFGS",
        f"Its own shadowed transfer, n = {ORDER}, {RAYS} rays a vertex. RMS over the total length of all "
        f"vertices, all bands "
        "counted. BFGS: all axes and coefficients, analytic gradient (eqs. 19 to 21), greedy start, run to "
        "convergence, on "
        f"{PEER_VERTICES} of the vertices; {harmonics.threads()} threads.",
        (
            "form",
            "N",
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
            "Of the two relatives: one fitted lobe has less error.",
            f"Simulation: {transfer.seconds:.3g} s, standard error {transfer.relative_error:.2%} of the length.",
        ),
        pictures=(_lit(shape, vectors, seen),),
    )


def _lit(shape: Spec | None, vectors: Array, seen: dict[str, Array]) -> Picture:
    """Return the shape under a light by its own transfer, and by what stands in for that."""
    scene = _seen(shape, HEAD_LIGHT)
    points, mesh = scene.points, scene.geometry.mesh
    assert mesh is not None
    corners = Corners.of(points, mesh.triangles)
    reflectance = np.sum([lobe.reflectance for lobe in scene.material.lobes], axis=0)
    light = project(scene.environment.radiance, ORDER - 1) * reflectance

    def radiance(of: Array) -> Array:
        return corners.blended((of[corners.lanes] @ light).astype(np.float32)).astype(float)

    exact = radiance(vectors)
    order = ("optimal", "N = 1", "N = 2", "N = 3", "N = 4")
    names = [next(name for name in seen if name.startswith(start)) for start in order]
    shown = {name: radiance(seen[name]) for name in names}
    return Picture(
        "head",
        f"The shape at rest under `{HEAD_LIGHT}`, n = {ORDER}: by whole transfer vectors, and by lobes with the error "
        "of the table.",
        _beside(points, "whole vectors", exact, shown),
    )


def _beside(points: Points, name: str, exact: Array, others: dict[str, Array]) -> bytes:
    """Lay out images of radiance (n, 3): the exact one, others, and what these have too much and too little."""
    stops, rms = exposure(exact), float(np.sqrt(np.mean(exact**2)))
    scale = Scale(0.2, f"RMS radiances by {name}")
    images = [Tile(exposed(points.image(values), stops)) for values in (exact, *others.values())]
    less = [Tile(signed(points.image((values - exact) / rms), scale.limit)) for values in others.values()]
    return compose(
        [images, [None, *less]], columns=[name, *others], labels=("image", f"less {name}"), notes=(toned(stops),),
        scale=scale,
    )  # fmt: skip


def glossy_head(shape: Spec | None = None) -> Study:
    """Return the errors of singular values left out and of the fit besides, by rows and lobes."""
    head, order, brdf = (
        _seen(shape, GLOSSY_LIGHT).geometry,
        4,
        materials.build({"kind": "cook-torrance", "roughness": 0.3}, GLOSSY),
    )
    mesh = head.mesh
    assert mesh is not None
    some = np.linspace(0, len(mesh.vertices) - 1, 4000).astype(int)
    directions = spread(1024)
    seen, frames = visible(head, directions), glossy.frames(mesh.normals[some])
    whole = glossy.factor(brdf, order, order**2)
    vectors = glossy.specialise(whole.rows, frames, directions, seen[some])
    light = project(environments.build(GLOSSY_LIGHT).radiance, order - 1)
    falling = ", ".join(f"{s:.2g}" for s in (whole.singular / whole.singular[0])[:10])
    own = np.cumsum(whole.singular[::-1] ** 2)[::-1]
    rows: list[tuple[str | float | int | None, ...]] = []
    for lobes, most in ((1, 3), (2, 3), (3, 10)):
        fitted = fit.fit(vectors[:, :most].reshape(-1, order**2), lobes).vectors().reshape(-1, most, order**2)
        for kept in (1, 3, 5, 7, 10) if lobes == 3 else (3,):
            errors, lit = (glossy.errors(vectors, kept, fitted[:, :kept], e) for e in (None, light))
            both = float(np.hypot(errors.svd, errors.fit))
            alone = float(np.sqrt(own[kept] / own[0]))
            judged = (errors.svd <= GOOD, errors.fit <= ACCURATE) if kept == lobes == 3 else (None, None)
            errors_of = errors.svd, errors.fit, both, lit.svd, lit.fit, alone
            rows.append((GLOSSY, kept, lobes, kept * lobes, *errors_of, *judged))
    for name, spec in OTHERS.items():
        alone = glossy.factor(materials.build(spec, name), order, 3).svd_error
        rows.append((name, 3, *[None] * 7, alone, None, None))
    return Study(
        "glossy-head" if shape is None else "glossy-patch",
        f"Cook-Torrance of roughness .3 on a {_named(shape)}, n = 4: rows and lobes, beside figure 4",
        "RMS over 4,000 vertices and all views of the 32 x 32 map, relative to the whole: under white light, for which "
        "every harmonic weighs the same, and under `studio` projected to four bands. Printed without numbers: "
        "n_b = 3 rows are a good approximation, N = 3 lobes a row an accurate fit.",
        (
            "BRDF", "n_b", "N", "lobes", "error of the rows left out", "further error of the fit", "both",
            "rows left out, under the studio", "fit, under the studio", "rows left out of the BRDF alone",
            f"good: rows left out at most {GOOD:g}", f"accurate: fit at most {ACCURATE:g}",
        ),
        tuple(rows),
        (
            f"Singular values: {falling} ... of the first. They fall slowly, so that in this norm three rows leave "
            "much out; the fit of what is kept is accurate.",
        ),
        pictures=(_glossy_lit(shape, whole, directions, seen, 3, 3),),
    )  # fmt: skip


def _glossy_lit(
    shape: Spec | None, whole: glossy.Factored, directions: Array, seen: NDArray[np.bool_], kept: int, lobes: int
) -> Picture:
    """Return the glossy head under a light: by all rows, by those kept, and by these as lobes."""
    scene = _seen(shape, GLOSSY_LIGHT)
    mesh = scene.geometry.mesh
    assert mesh is not None
    corners = Corners.of(scene.points, mesh.triangles)
    vertex, lane = np.unique(corners.lanes, return_inverse=True)
    frames = glossy.frames(mesh.normals[vertex])
    vectors = glossy.specialise(whole.rows, frames, directions, seen[vertex])
    n2 = vectors.shape[-1]
    light = project(scene.environment.radiance, round(np.sqrt(n2)) - 1)
    factors = glossy.view_factors(whole, corners.spread(scene.points.view), frames[lane])

    def radiance(rows: Array) -> Array:
        sent = np.einsum("kjc,kjc->kc", factors[:, : rows.shape[1]], (rows @ light)[lane])
        return corners.blended(sent.astype(np.float32)).astype(float)

    fitted = fit.fit(vectors[:, :kept].reshape(-1, n2), lobes).vectors().reshape(-1, kept, n2)
    exact = radiance(vectors)
    shown: dict[str, Array] = {}
    for name, rows in ((f"n_b = {kept} rows", vectors[:, :kept]), (f"n_b = {kept}, N = {lobes} lobes a row", fitted)):
        found = radiance(rows)
        shown[f"{name}: RMS {_nrmse(found, exact):.3f}"] = found
    return Picture(
        "glossy head",
        "Cook-Torrance of roughness .3 under `studio` projected to four bands, at rest; RMS over the pixels.",
        _beside(scene.points, "all rows", exact, shown),
    )


def _seen(shape: Spec | None, light: Spec | str) -> Scene:
    """Return the head at rest, or another shape, under a light, as a camera sees it."""
    return CATALOGUE.scene(
        name="head",
        light=CATALOGUE.lights[light] if isinstance(light, str) else light,
        material=CATALOGUE.materials["lambertian"],
        geometry=CATALOGUE.geometries["head"] if shape is None else shape,
        view={"kind": "image", "size": 160, "direction": [0.3, -1.0, 0.25 if shape is None else 1.5]},
        effects=None,
    )


def _named(shape: Spec | None) -> str:
    return "head" if shape is None else "woven patch"


def _nrmse(found: Array, exact: Array) -> float:
    return float(np.sqrt(np.mean((found - exact) ** 2) / np.mean(exact**2)))


def _rms(lobes: Lobes, vectors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum((lobes.vectors() - vectors) ** 2, axis=1))))
