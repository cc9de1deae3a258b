"""Light that differs over the shape: eq. 13 of Sloan, Luna and Snyder 2005 with tables of the harmonics."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.contact_sheet import compose
from benchmarks.studies.renderings import LOCAL, SCALE, TONED, Rendering, rendered
from envbench import harmonics, real_harmonics
from envbench.directions import Array, normalised
from envbench.records import Picture, Study
from methods.ldprt import fit, rotation, shade, table
from methods.ldprt.corners import Corners
from methods.ldprt.lobes import Lobes
from methods.ldprt.simulated import SIMULATIONS, Request
from methods.ldprt.transfer import Kind

ORDER, LOBES, RAYS = 6, 4, 1000
LIGHTS = ("studio-6", "esplanade-6")
SHAPE = {
    "kind": "patch", "tiles": [5, 4], "size": [2.5, 2.0], "resolution": [121, 97], "texture": "weave", "height": 0.1,
    "pose": [{"kind": "onto", "surface": "vase"}, {"kind": "bend", "degrees": 50.0, "axis": "z", "towards": "x"}],
}  # fmt: skip
LAMP = 0.25
"""Radius of the lamp beside the shape, in the shape's height."""
SAMPLES = 3
"""Places along each side of the shape's box at which light is sampled: 27 in all."""


@dataclass(frozen=True, eq=False)
class _Shape:
    """What is shaded: evaluations (k,), their transfer, turns and places, and how they blend to n points."""

    corners: Corners
    vectors: Array
    lobes: Lobes
    rotations: Array
    position: Array

    @cached_property
    def packed(self) -> shade.Packed:
        return shade.pack(self.lobes.axes, self.lobes.coefficients, self.lobes.direct)

    def exact(self, light: Array) -> Array:
        """Return t . e for lights (k, n^2, 3), in double precision."""
        return np.einsum("ks,ksc->kc", rotation.rotate(self.vectors, self.rotations), light)


@dataclass(frozen=True, eq=False)
class Lamp:
    """A sphere at a place (3,) that shines alike everywhere, with `radiance`."""

    place: Array
    radius: float
    radiance: float

    @classmethod
    def beside(cls, position: Array) -> Lamp:
        """Return a lamp in front of places (k, 3) and above, which gives their middle an irradiance of pi at most."""
        extent = np.ptp(position, axis=0).max()
        away = extent * np.array([0.0, -1.0, 0.6])
        radius = float(LAMP * extent)
        return cls((position.min(0) + position.max(0)) / 2 + away, radius, float(away @ away) / radius**2)

    def vectors(self, position: Array) -> Array:
        """Return light vectors (k, n^2, 3) at places (k, 3) outside it.

        Seen from there it is a disk about the direction of its middle, of half-angle a, sin a = radius / distance: a
        zonal function, g*_l = 2 pi int_cos(a)^1 P_l(z) dz = 2 pi (P_(l-1) - P_(l+1))(cos a) / (2 l + 1), P_-1 = 1.
        """
        away = self.place - position
        cosine = np.sqrt(1 - (self.radius / np.linalg.norm(away, axis=1)) ** 2)
        P = np.polynomial.legendre.legvander(cosine, ORDER)
        before = np.concatenate([np.ones((len(P), 1)), P[:, :-2]], axis=1)
        g = 2 * np.pi * (before - P[:, 1:]) / (2 * np.arange(ORDER) + 1)
        band = np.repeat(np.arange(ORDER), 2 * np.arange(ORDER) + 1)
        e = self.radiance * g[:, band] * real_harmonics.basis(ORDER - 1, normalised(away)).T
        return np.repeat(e[..., None], 3, axis=2)


def varying_light() -> Study:
    """Return errors and rates of shading under lights that differ from point to point."""
    views = [rendered(SHAPE, LOCAL, light=name) for name in LIGHTS]
    shape = _shape(views[0])
    two = [real_harmonics.project(v.scene.environment.radiance, ORDER - 1) * _reflectance(v) for v in views]
    height = _unit(shape.position)[:, 2]
    share = height * height * (3 - 2 * height)  # from one light to the other, smoothly
    blend = (1 - share)[:, None, None] * two[0] + share[:, None, None] * two[1]
    seen = shape.corners.blended(np.repeat(share[:, None], 3, axis=1).astype(np.float32))[:, :1]
    shares = np.stack([1 - seen, seen])
    truth = (shares * [view.truth.mean for view in views]).sum(0)
    noise = ((shares * [view.truth.standard_error for view in views]) ** 2).sum(0)
    lamp = Lamp.beside(shape.position)
    near = lamp.vectors(shape.position) * _reflectance(views[0])
    sampled = _sampled(lamp, shape.position) * _reflectance(views[0])
    rows: list[tuple[str | float | bool | None, ...]] = []
    pictured: dict[str, NDArray[np.float32]] = {}
    for name, exact_light, given in (("two captured lights", blend, blend), ("a lamp beside it", near, sampled)):
        rows += _rows(name, shape, exact_light, given, (truth, noise) if given is blend else None, pictured)
    return Study(
        "varying-light",
        "Light that differs over the shape: a bent vase, each point with a light vector of its own",
        f"n = {ORDER}, N = {LOBES}, {RAYS} rays a vertex; {len(shape.position):,} evaluations, three channels, "
        f"{harmonics.threads()} threads. Two captured lights pass into each other with height. The lamp is a sphere "
        f"beside the shape, its light vector at a point in closed form; what is shaded with is sampled at {SAMPLES}^3 "
        "places of the shape's box and trilinear between. Errors are RMS, relative to the RMS of the exact radiance: "
        "against t . e of every point, its whole transfer vector turned in double precision, its own light; of the two "
        "lights also against Mitsuba's references of both, blended by the same shares, their noise taken "
        "off. Medians of 9 rounds.",
        ("light", "way", "against t . e", "against Mitsuba", "below one light for all", "ms", "million points/s"),
        tuple(rows),
        ("With a light for each point no table can be made of the light: tables of the harmonics are what is left.",),
        pictures=(_picture(views[0], truth, pictured),),
    )


def _rows(
    light: str, shape: _Shape, exact_light: Array, given: Array, truth: tuple[Array, Array] | None,
    pictured: dict[str, NDArray[np.float32]],
) -> list[tuple[str | float | bool | None, ...]]:  # fmt: skip
    packed, harmonic = shape.packed, table.harmonics(ORDER)
    exact = shape.exact(exact_light)
    one = given.mean(0)
    single = given.astype(np.float32)
    ways: list[tuple[str, Callable[[], NDArray[np.floating]]]] = [
        ("lobes, harmonics from tables", lambda: shade.locally(packed, single, harmonic, shape.rotations)),
        ("lobes, harmonics evaluated", lambda: shade.evaluated(packed, single, shape.rotations)),
        ("whole vectors, full SH rotation",
         lambda: shade.full(shape.vectors, single, shape.rotations, shade.Turning.TRANSFER)),
        ("lobes, one light for all", lambda: shade.evaluated(packed, one, shape.rotations)),
    ]  # fmt: skip
    found = {name: np.asarray(way(), float) for name, way in ways}
    scale = _rms(exact)
    worst = _rms(found["lobes, one light for all"] - exact) / scale
    rows: list[tuple[str | float | bool | None, ...]] = []
    for name, way in ways:
        error, seconds = _rms(found[name] - exact) / scale, _median(way)
        against = None
        if truth is not None:
            pictured[name] = shape.corners.blended(found[name].astype(np.float32))
            against = float(np.sqrt(max(np.mean((pictured[name] - truth[0]) ** 2 - truth[1]), 0))) / _rms(truth[0])
        better = None if name.endswith("for all") else error < worst
        rows.append((light, name, error, against, better, 1e3 * seconds, len(exact) / seconds / 1e6))
    return rows


def _picture(view: Rendering, truth: Array, found: dict[str, NDArray[np.float32]]) -> Picture:
    blended = Rendering(view.scene, replace(view.truth, replicates=np.repeat(truth[None], 2, axis=0)))
    ours, one = found["lobes, harmonics from tables"], found["lobes, one light for all"]
    sheet = compose(
        [
            [blended.reference(), blended.tile(ours), blended.tile(one)],
            [None, blended.difference(ours, SCALE), blended.difference(one, SCALE)],
        ],
        columns=("reference", "lobes, a light a point", "one light for all"),
        labels=("image", "less the reference"),
        notes=(TONED,),
        scale=SCALE,
    )
    return Picture("two lights", f"`{LIGHTS[0]}` below passes into `{LIGHTS[1]}` above.", sheet)


def _shape(view: Rendering) -> _Shape:
    scene = view.scene
    mesh, points = scene.geometry.mesh, scene.points
    assert mesh is not None
    assert points.rotation is not None
    transfer = SIMULATIONS.get(scene.geometry, Request(ORDER, Kind.SHADOWED, RAYS, 0, 1.0, 0))
    corners = Corners.of(points, mesh.triangles)
    vertex, lane = np.unique(corners.lanes, return_inverse=True)
    found = fit.fit(transfer.vectors[vertex], LOBES)
    lobes = Lobes(found.axes[lane], found.coefficients[lane], found.direct[lane])
    turns, place = corners.spread(points.rotation), corners.spread(points.position)
    return _Shape(corners, transfer.vectors[corners.lanes], lobes, turns, place)


def _unit(position: Array) -> Array:
    """Return places (k, 3) in the box about them, [0, 1]^3."""
    low, high = position.min(0), position.max(0)
    return (position - low) / (high - low)


def _sampled(lamp: Lamp, position: Array) -> Array:
    """Return the lamp's light vectors as they are between places where light is sampled, trilinear."""
    from scipy.interpolate import RegularGridInterpolator

    sides = [np.linspace(low, high, SAMPLES) for low, high in zip(position.min(0), position.max(0), strict=True)]
    places = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1)
    vectors = lamp.vectors(places.reshape(-1, 3)).reshape(*places.shape[:3], -1)
    return RegularGridInterpolator(sides, vectors)(position).reshape(len(position), -1, 3)


def _reflectance(view: Rendering) -> Array:
    return np.sum([lobe.reflectance for lobe in view.scene.material.lobes], axis=0)


def _median(run: Callable[[], NDArray[np.floating]]) -> float:
    seconds: list[float] = []
    for _ in range(9):
        start = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - start)
    return float(np.median(seconds))


def _rms(values: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=float))))
