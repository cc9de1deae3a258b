"""SHRM in global form: V in global coordinates, so that one viewer's map is one product (RH 2002, eqs. 8 and 12)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from envbench import latlong
from envbench.directions import to_angles
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, Viewer
from envbench.harmonics import Coefficients
from envbench.material import Centre, Material
from envbench.method import Tolerance
from envbench.real_harmonics import basis
from envbench.scene import Scene
from methods.shrm import cube, lookup, maps, predictions, rotation
from methods.shrm.coefficients import LobeCoefficients
from methods.shrm.expansion import Expanded, Expansion, constant_light

MAX_BYTES = 2**31
"""Of all maps under one light."""
LEAST_SIZE = 64
"""Of cube faces and of lat-long rows, where none is given and the orders need no more: as in RH 2002, sec. 7.4."""
SAMPLES_PER_ORDER = 4
"""Samples in half a turn for each order of F + P, the degree of the map that one viewer sees."""


@dataclass(frozen=True)
class Prepared:
    """The expansion, and the size of the map of each centre."""

    expansion: Expanded
    sizes: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class GlobalMap:
    """One centre's map under one light: `coefficients` ((P + 1)^2, 3 texels), real, in global coordinates of V."""

    centre: Centre
    P: int
    radial: bool
    size: int
    coefficients: NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class DynamicMap:
    """What one viewer sees in every central direction: `texels` (k, 3)."""

    centre: Centre
    size: int
    texels: NDArray[np.floating]


@dataclass(frozen=True)
class SHRMGlobal(Expansion):
    """Global SHRM: texels hold harmonics of V in global coordinates; a frame is one product, a point one lookup.

    The viewer is distant: with an eye, the direction of its axis stands for all points, and that is the error made.
    Lobes about one centre share a map.

    Parameters
    ----------
    storage : {"cube", "latlong"}
        Six faces of `size` x `size` texels, or `size` x 2 `size`; either is read bicubically.
    size : int
        0 takes 64, or more where the orders need it: 4 (F + P + 1) samples in half a turn.
    """

    precision: str = "float32"
    storage: str = "cube"
    size: int = 0

    name = "shrm-global"
    summary = "global spherical harmonic reflection map, one dynamic map a frame, one lookup a point"
    source = "Ramamoorthi and Hanrahan 2002, eqs. 8 and 12"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.storage not in ("cube", "latlong"):
            raise BadInput(f"storage must be 'cube' or 'latlong'. Got '{self.storage}' instead.")
        if self.size and not 4 <= self.size <= 4096:
            raise BadInput(f"size must be 0 (chosen from the orders) or lie in [4, 4096]. Got {self.size} instead.")

    def declines(self, scene: Scene) -> str | None:
        if scene.viewer is None and not all(lobe.radially_symmetric for lobe in scene.material.lobes):
            return "its dynamic map is what one viewer sees, and here every point has a view of its own"
        return super().declines(scene)

    def prepare(self, material: Material, geometry: Geometry) -> Prepared:
        expansion = self.expand(material)
        sizes = tuple(self._size(c) for c in expansion.sums)
        values = sum(3 * (c.P + 1) ** 2 * self._texels(n) for c, n in zip(expansion.sums, sizes, strict=True))
        size = values * np.dtype(self.precision).itemsize
        if size > MAX_BYTES:
            raise BadInput(f"its maps would take {size / 2**30:.1f} GiB; raise eps, lower size, or take float32.")
        return Prepared(expansion, sizes)

    def expansion(self, prepared: Prepared) -> Expanded:
        return prepared.expansion

    def relight(self, prepared: Prepared, environment: Environment) -> tuple[GlobalMap, ...]:
        sums = prepared.expansion.sums
        lights = prepared.expansion.light(environment.radiance.astype(self.precision, copy=False))
        return tuple(self._map(c, light, size) for c, light, size in zip(sums, lights, prepared.sizes, strict=True))

    def frame(self, relit: tuple[GlobalMap, ...], viewer: Viewer | None) -> tuple[DynamicMap, ...]:
        view = np.zeros(3)
        if viewer is not None:
            view = np.array(viewer.direction) if viewer.direction else -np.array(viewer.axis)
        return tuple(DynamicMap(m.centre, m.size, seen(m, view)) for m in relit)

    def shade(self, framed: tuple[DynamicMap, ...], points: Points) -> NDArray[np.floating]:
        out = np.zeros((len(points), 3))
        for m in framed:
            out += self._matrix(points.central(m.centre), m.size) @ m.texels
        return out

    def lookup(self, prepared: Prepared, stored: int) -> predictions.Lookup:
        return partial(lookup.loss, spacing=self._spacing(prepared.sizes[stored]))

    def describe(self, prepared: Prepared) -> dict[str, Any]:
        return {**super().describe(prepared), "size": list(prepared.sizes)}

    def tolerance(self, prepared: Prepared) -> Tolerance:
        """As for local SHRM; a turn meets lookup's error at degree F, (3/128) (spacing F)^4, at most all of it.

        The lights of the laws vary over half a radian and more: their degree is at most 8.
        """
        degree = min(8, prepared.expansion.order) + max(c.P for c in prepared.expansion.sums)
        lost = min(3 / 128 * (self._spacing(min(prepared.sizes)) * degree) ** 4, 1.0)
        return Tolerance(linearity=1e-5, constant_light=constant_light(prepared.expansion), rotation=1e-3 + lost)

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [cls(eps=eps) for eps in (0.3, 0.1, 0.03, 0.01, 0.003)]

    def _map(self, lobe: LobeCoefficients, light: Coefficients, size: int) -> GlobalMap:
        if self.storage == "cube":
            where = cube.texels(size, cube.BORDER)
            planes = maps.at(lobe, maps.products(lobe, light), where, cube.ACCURACY)
        else:
            where = np.stack(to_angles(latlong.grid(size, 2 * size).reshape(-1, 3)), axis=-1)
            planes = maps.synthesise(lobe, light, size).reshape(3, -1, len(where))
        coefficients = np.moveaxis(planes, 0, 2) if lobe.radial else rotation.to_global(lobe, planes, where)
        flat = np.ascontiguousarray(coefficients.reshape(len(coefficients), -1))
        return GlobalMap(lobe.centre, lobe.P, lobe.radial, size, flat)

    def _size(self, lobe: LobeCoefficients) -> int:
        samples = SAMPLES_PER_ORDER * (lobe.F + lobe.P + 1)
        needed = samples if self.storage == "latlong" else int(np.ceil(samples * 2 / np.pi))
        return self.size or max(LEAST_SIZE, needed)

    def _spacing(self, size: int) -> float:
        return np.pi / size if self.storage == "latlong" else 2 / size

    def _texels(self, size: int) -> int:
        return 2 * size**2 if self.storage == "latlong" else 6 * (size + 2 * cube.BORDER) ** 2

    def _matrix(self, directions: NDArray[np.float64], size: int) -> sparse.csr_array:
        if self.storage == "cube":
            return cube.matrix(directions, size)
        return lookup.matrices(directions, size, 2 * size)[0]


def seen(stored: GlobalMap, view: NDArray[np.float64]) -> NDArray[np.floating]:
    """Return equation 12 for one view: the map's texels (k, 3)."""
    if stored.radial:
        return stored.coefficients.reshape(-1, 3)
    weights = basis(stored.P, view).astype(stored.coefficients.dtype)
    return (weights @ stored.coefficients).reshape(-1, 3)
