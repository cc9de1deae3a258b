"""Split sum (Karis 2013): a prefiltered environment at R times what the lobe reflects of constant light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from data_gen.environments.resample import downsampled
from data_gen.lobes import GGX, Lambertian
from envbench import harmonics
from envbench.directions import Array, from_angles
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.material import Centre, Lobe, Material
from envbench.method import Method, Tolerance
from envbench.scene import Scene
from methods.irradiance import ORDER, finished, quadratic_form, reflected, vectors
from methods.split_sum import kernel
from methods.split_sum.cube import look_up, packed, texels

LEAST_FACE = 8
"""Texels along the faces of the smallest level."""
LATTICE = 4181, 2584
"""Points and generator (neighbours of Fibonacci) of the quadrature of a lobe's albedo: to 1e-3, clipped or not."""
SHARP, FAINT = 0.8, 0.05
"""k_l above which a degree counts as untouched, and below which as gone."""
ACCURACY = 1e-5
"""Of the synthesis at the texels, relative to the RMS of the map."""


@dataclass(frozen=True, eq=False)
class Level:
    """How one cube map is made: faces of `size` x `size`, the light filtered by `kernel` (channels, order + 1)."""

    size: int
    kernel: Array


@dataclass(frozen=True, eq=False)
class Reading:
    """How a lobe is read: level `at` (a fraction blends two), times `table` (T, 3) at n.v = (k / (T - 1))^2."""

    at: float
    table: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Prepared:
    """Of a material: cube maps to make, how its lobes about R read them, and its diffuse reflectance (3,)."""

    levels: tuple[Level, ...]
    readings: tuple[Reading, ...]
    diffuse: Array
    texels: dict[int, Array]
    """(theta, phi) of the texels of each size."""
    table_error: float
    """What the tables would lose with half their entries, relative to their RMS."""
    mapping: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Relit:
    """The prefiltered cubes, each (6 (size + 2)^2, 4), and the diffuse quadratic form (10, 3)."""

    cubes: tuple[NDArray[np.float32], ...]
    form: NDArray[np.float32]
    prepared: Prepared


@dataclass(frozen=True)
class SplitSum(Method):
    """Specular light as (light averaged about R with the lobe for N = V = R) times (the lobe's albedo at n.v).

    The average is exact, by convolution in the frequency domain, where engines take 32 to 1024 samples of it. Diffuse
    light is `irradiance-9`. The albedo f0 A + B of Karis is tabulated as it is needed: at the lobe's own roughness and
    f0, so that constant light comes out right. The same two factors exist for any lobe about R, not for GGX alone.

    Attributes
    ----------
    face : int
        Texels along a face of the (largest) cube map.
    levels : int
        0: a cube map for each lobe, filtered with its own kernel. 2 or more: the chain that an engine shares among all
        materials, level k for GGX of roughness k / (levels - 1) with faces of half the size each; lobes are read
        between two levels, at their roughness or, if not GGX, at the one whose kernel is nearest.
    table : int
        Entries over n.v.
    """

    name = "split-sum"
    summary = "stores cube maps prefiltered for N = V = R, read at R, times a table over n.v; diffuse by irradiance-9"
    source = "Karis 2013, Real Shading in Unreal Engine 4, sec. Image-Based Lighting (split sum approximation)"

    face: int = 32
    levels: int = 0
    table: int = 65

    def __post_init__(self) -> None:
        if not 4 <= self.face <= 1024:
            raise BadInput(f"face must lie in [4, 1024]. Got {self.face} instead.")
        if self.levels != 0 and not 2 <= self.levels <= 16:
            raise BadInput(f"levels must be 0 (a map for each lobe) or lie in [2, 16]. Got {self.levels} instead.")
        if not 3 <= self.table <= 4096 or self.table % 2 == 0:
            raise BadInput(f"table must be odd and lie in [3, 4096]. Got {self.table} instead.")

    def declines(self, scene: Scene) -> str | None:
        return _reason(scene.material)

    def prepare(self, material: Material, geometry: Geometry) -> Prepared:
        """Tabulate the lobes' albedos, and expand their kernels or find their roughness."""
        reason = _reason(material)
        if reason:
            raise BadInput(f"split-sum cannot render material '{material.name}': {reason}")
        diffuse = [lobe.reflectance for lobe in material.lobes if isinstance(lobe, Lambertian)]
        lobes = [lobe for lobe in material.lobes if not isinstance(lobe, Lambertian)]
        tables = [_albedo(lobe, self.table) for lobe in lobes]
        if self.levels:
            sizes = [max(self.face >> k, min(LEAST_FACE, self.face)) for k in range(self.levels)]
            roughness = np.arange(self.levels) / (self.levels - 1)
            levels = [Level(s, kernel.ggx(r**2, _cap(s))) for s, r in zip(sizes, roughness, strict=True)]
            equivalent = [kernel.equivalent_roughness(lobe) for lobe in lobes]
            places = [r * (self.levels - 1) for r in equivalent]
            mapping = [f"{_kind(lobe)} at roughness {r:.3f}" for lobe, r in zip(lobes, equivalent, strict=True)]
        else:
            levels = [Level(self.face, kernel.own(lobe, _cap(self.face))) for lobe in lobes]
            places = [float(k) for k in range(len(lobes))]
            mapping = [_kind(lobe) for lobe in lobes]
        return Prepared(
            tuple(levels) if lobes else (),
            tuple(Reading(at, table.astype(np.float32)) for at, table in zip(places, tables, strict=True)),
            np.sum([(0.0, 0.0, 0.0), *diffuse], axis=0),
            {level.size: texels(level.size) for level in levels},
            max(map(_lost_by_half, tables), default=0.0),
            tuple(mapping),
        )

    def relight(self, prepared: Prepared, environment: Environment) -> Relit:
        """Filter the light in the frequency domain, and sum it at the texels of every level."""
        width = environment.radiance.shape[1]
        kernels = [_fitting(level.kernel, width) for level in prepared.levels]
        order = max([ORDER, *(k.shape[1] - 1 for k in kernels if k is not None)])
        significant = max([ORDER, *(_significant(k) for k in kernels if k is not None)])
        light = harmonics.analyse(environment.radiance, order, significant)
        cubes = [
            _mirrored(environment, level.size, where) if k is None else _filtered(light, order, k, where)
            for level, k in zip(prepared.levels, kernels, strict=True)
            for where in (prepared.texels[level.size],)
        ]
        form = quadratic_form(harmonics.truncate(light, order, ORDER), prepared.diffuse)
        return Relit(tuple(cubes), form, prepared)

    def shade(self, framed: Relit, points: Points) -> NDArray[np.floating]:
        """Read every lobe's cube and table, and the quadratic form, in one kernel."""
        normal, view = vectors(points.normal), vectors(points.view)

        import drjit as dr

        facing = dr.dot(normal, view)
        mirrored = 2 * facing * normal - view
        value = reflected(framed.form, normal)
        for reading in framed.prepared.readings:
            value += _read(framed, reading.at, mirrored) * _between(reading.table, facing)
        return finished(value)

    def describe(self, prepared: Prepared) -> dict[str, Any]:
        return {
            "kernel": list(prepared.mapping),
            "faces": [level.size for level in prepared.levels],
            "orders": [level.kernel.shape[1] - 1 for level in prepared.levels],
        }

    def tolerance(self, prepared: Prepared) -> Tolerance:
        """Allow for the tables and the cubes' texels.

        Constant light: the quadrature of the table, and half of what it would lose with half as many entries. Rotation:
        bilinear texels of 2 / s radians leave h^2 / 8 of second derivatives in each of two directions, as in the lamps
        of `envbench.laws` (half a radian wide: 4); N = V = R itself turns with the light.
        """
        texel = 2 / min((level.size for level in prepared.levels), default=1024)
        return Tolerance(
            linearity=5e-5, constant_light=2e-3 + prepared.table_error, rotation=1e-3 + 2 * 4 * texel**2 / 8
        )

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [cls(face=8, table=33), cls(face=16), cls(face=32), cls(face=128), cls(face=128, levels=6)]


def _reason(material: Material) -> str | None:
    for lobe in material.lobes:
        if lobe.centre is Centre.NORMAL and not isinstance(lobe, Lambertian):
            return f"its {_kind(lobe)} lobe is about the normal but not Lambertian: irradiance-9 cannot hold it."
        if lobe.centre is Centre.TANGENT:
            return f"its {_kind(lobe)} lobe is about the tangent; the map is prefiltered about R."
    return None


def _kind(lobe: Lobe) -> str:
    return "exact GGX" if isinstance(lobe, GGX) else f"own kernel of {type(lobe).__name__.lower()}"


def _cap(size: int) -> int:
    """Return the highest degree of a level: twice what its texels, 4 `size` around the sphere, can hold."""
    return min(4 * size, kernel.MAX_ORDER)


def _albedo(lobe: Lobe, count: int) -> Array:
    """Return what the lobe reflects of constant light at n.v = (k / (count - 1))^2, (count, 3).

    The mean of rho_hat / p over a Fibonacci lattice of the lobe's own samples (Sloan and Joe 1994).
    """
    i = np.arange(LATTICE[0])
    u = ((i + 0.5) / LATTICE[0], i * LATTICE[1] / LATTICE[0] % 1)
    view = from_angles(np.arccos((np.arange(count) / (count - 1)) ** 2), 0.0).T[..., None]
    normal = np.array([0.0, 0.0, 1.0])[:, None, None]
    frame = view, view * np.array([-1.0, -1.0, 1.0])[:, None, None], normal
    light = lobe.sample(u, *frame)
    density = lobe.density(light, *frame)
    drawn = density > 0
    over = np.divide(1.0, density, out=np.zeros_like(density), where=drawn)
    return np.stack([(value * over).mean(1) for value in lobe.evaluate(light, *frame)], -1)


def _lost_by_half(table: Array) -> float:
    midway = (table[:-2:2] + table[2::2]) / 2
    return float(abs(midway - table[1::2]).max() / (np.sqrt((table**2).mean()) or 1.0))


def _fitting(filtering: Array, width: int) -> Array | None:
    """Return a kernel to the degree that a light of so many columns calls for; None is a mirror.

    A kernel that hardly damps the light's own highest degrees, `width` / 2, or twice these, blurs less than a pixel;
    one that has all but ended there is cut, since the light has next to nothing beyond.
    """
    own = width // 2 - 1
    if filtering[:, min(max(width, 64), filtering.shape[1] - 1)].min() > SHARP:
        return None
    if filtering.shape[1] > own and filtering[:, own].max() < FAINT:
        return filtering[:, : own + 1]
    return filtering


def _significant(filtering: Array) -> int:
    """Return the degree beyond which errors of the light's coefficients hardly count."""
    return int(np.flatnonzero(abs(filtering).max(0) > 2 * FAINT)[-1])


def _filtered(light: harmonics.Coefficients, order: int, filtering: Array, where: Array) -> NDArray[np.float32]:
    """Return one cube from the light's coefficients: each degree l times k_l, summed at the texels."""
    highest = filtering.shape[1] - 1
    l, _ = harmonics.degrees(highest)
    damped = harmonics.truncate(light, order, highest) * filtering[:, l].astype(light.real.dtype)
    return packed(harmonics.synthesise_at(damped, highest, where, ACCURACY).T)


def _mirrored(environment: Environment, size: int, where: Array) -> NDArray[np.float32]:
    """Return one cube of the light itself, averaged down where its pixels are finer than the texels."""
    if environment.radiance.shape[0] > 2 * size:
        environment = downsampled(environment, 2 * size)
    return packed(environment(from_angles(where[:, 0], where[:, 1])))


def _read(framed: Relit, at: float, direction: Any) -> Any:
    """Read the cubes at level `at`, trilinear where it lies between two."""
    lower, share = floor(at), at - floor(at)
    value = look_up(framed.cubes[lower], framed.prepared.levels[lower].size, direction)
    if share:
        upper = look_up(framed.cubes[lower + 1], framed.prepared.levels[lower + 1].size, direction)
        value = (1 - share) * value + share * upper
    return value


def _between(table: NDArray[np.float32], facing: Any) -> Any:
    """Interpolate a table (T, 3) over n.v = (k / (T - 1))^2."""
    import drjit as dr
    from drjit.llvm import Array3f, Float, UInt32

    place = dr.sqrt(dr.clip(facing, 0, 1)) * (len(table) - 1)
    entry = dr.minimum(UInt32(place), len(table) - 2)
    entries = Float(table.ravel())
    return dr.lerp(dr.gather(Array3f, entries, entry), dr.gather(Array3f, entries, entry + 1), place - entry)
