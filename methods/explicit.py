"""Explicit 4D tables B(alpha, beta, theta_o, phi_o), filled from spherical harmonic reflection maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, pi, sqrt
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from envbench import harmonics
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.laws import WIDEST
from envbench.material import Centre, Material
from envbench.method import Method, Tolerance
from envbench.scene import Scene
from methods.angular.lookup import look_up
from methods.shrm import explicit, maps
from methods.shrm.coefficients import LobeCoefficients, expand

MAX_BYTES = 2**31
"""Of all tables under one light."""


@dataclass(frozen=True)
class Resolution:
    """A lobe's coefficients, and the S x 2 S central by T x T view directions of its table."""

    coefficients: LobeCoefficients
    rows: int
    directions: int

    @property
    def bytes(self) -> int:
        """Size of the table."""
        return 3 * 4 * 2 * self.rows**2 * self.directions**2

    @property
    def unevenness(self) -> float:
        """The RMS error, relative to the RMS, that linear interpolation over theta_o makes under constant light."""
        lobe = self.coefficients
        if self.directions == 1:
            return 0.0
        nodes = explicit.polar_nodes(lobe.centre, self.directions)
        theta = np.linspace(nodes[0], nodes[-1], 16 * self.directions)
        exact, at_nodes = (explicit.zonal_basis(lobe, t).T @ lobe.rho[:, 0, :, 0].T for t in (theta, nodes))
        found = np.stack([np.interp(theta, nodes, channel) for channel in at_nodes.T], axis=1)
        sine = np.sin(theta)[:, None]
        whole = float(np.sum(exact**2 * sine))
        return sqrt(float(np.sum((found - exact) ** 2 * sine)) / whole) if whole > 0 else 0.0


@dataclass(frozen=True, eq=False)
class Table:
    """One lobe's reflected radiance, `values` (S, 2 S, T, T, 3): over central and local view directions."""

    centre: Centre
    values: NDArray[np.float32]


@dataclass(frozen=True)
class Explicit(Method):
    """Tabulate an SHRM at all central and view directions, and look the table up: fast to fill, large to keep.

    The table and its lookup are those of `methods.angular`, which fills them by hemispherical integration. A lobe whose
    SHRM has P = 0 does not depend on the view and takes a single map.

    Attributes
    ----------
    eps : float
        Energy of the BRDF that the SHRM may leave out.
    rows : int
        S; 0 takes `samples` times F, at least 16.
    directions : int
        T, even; 0 takes `samples` times P.
    samples : float
        Samples per order; the paper's rule, S ~ 10 F and T ~ 10 P, is 10. Bilinear lookup errs by about
        (pi / samples)^2 / 8 of the highest frequency.
    """

    eps: float = 0.01
    rows: int = 0
    directions: int = 0
    samples: float = 10.0

    name = "explicit"
    summary = "explicit T x T reflection maps, tabulated from spherical harmonic ones; bilinear lookup"
    source = "Ramamoorthi and Hanrahan 2002, sec. 6.2 (3D BRDFs, explicit reflection maps) and appendix C"

    def __post_init__(self) -> None:
        if not 0 < self.eps < 1:
            raise BadInput(f"eps must lie in (0, 1). Got {self.eps} instead.")
        if self.rows and not 2 <= self.rows <= 4096:
            raise BadInput(f"rows must be 0 (chosen from F) or lie in [2, 4096]. Got {self.rows} instead.")
        if self.directions and (not 2 <= self.directions <= 128 or self.directions % 2):
            raise BadInput(
                f"directions must be 0 (chosen from P) or even and lie in [2, 128]. Got {self.directions} instead."
            )
        if not 2 <= self.samples <= 100:
            raise BadInput(f"samples must lie in [2, 100] an order. Got {self.samples} instead.")

    def declines(self, scene: Scene) -> str | None:
        if any(lobe.centre is Centre.TANGENT and lobe.clipped for lobe in scene.material.lobes):
            return "a clipped lobe about the tangent also depends on the normal: one dimension more than T x T maps."
        return None

    def prepare(self, material: Material, geometry: Geometry) -> tuple[Resolution, ...]:
        prepared = tuple(self._resolution(expand(lobe, self.eps)) for lobe in material.lobes)
        size = sum(p.bytes for p in prepared)
        if size > MAX_BYTES:
            raise BadInput(f"its tables would take {size / 2**30:.1f} GiB; raise eps, or lower samples or directions.")
        return prepared

    def relight(self, prepared: tuple[Resolution, ...], environment: Environment) -> tuple[Table, ...]:
        order = max(p.coefficients.F for p in prepared)
        significant = max(p.coefficients.significant for p in prepared)
        light = harmonics.analyse(environment.radiance, order, significant)

        def table(wanted: Resolution) -> Table:
            lobe = wanted.coefficients
            planes = maps.synthesise(lobe, harmonics.truncate(light, order, lobe.F), wanted.rows)
            return Table(lobe.centre, explicit.views(lobe, planes, wanted.directions))

        return tuple(table(p) for p in prepared)

    def shade(self, framed: tuple[Table, ...], points: Points) -> NDArray[np.floating]:
        first, *others = (look_up(table.values, table.centre, points) for table in framed)
        return sum(others, start=first)

    def predictions(self, prepared: tuple[Resolution, ...], environment: Environment) -> dict[str, float]:
        """1 - captured BRDF energy of the SHRM (RH 2002, sec. 5.1): what interpolation loses comes on top of it."""
        total = sum(p.coefficients.total for p in prepared)
        missing = sum(p.coefficients.missing * p.coefficients.total for p in prepared)
        return {"captured BRDF energy": missing / total if total else 0.0}

    def describe(self, prepared: tuple[Resolution, ...]) -> dict[str, Any]:
        return {
            "F": [p.coefficients.F for p in prepared],
            "P": [p.coefficients.P for p in prepared],
            "S": [p.rows for p in prepared],
            "T": [p.directions for p in prepared],
            "MiB": [round(p.bytes / 2**20, 1) for p in prepared],
        }

    def tolerance(self, prepared: tuple[Resolution, ...]) -> Tolerance:
        """Allow for what P leaves out of an integral, as for SHRM, and for bilinear lookup, d^2 / 8 of the curvature.

        Constant light: linear interpolation over theta_o of the terms l = 0, an RMS of which a few views may show three
        times as much. Turned light: a curvature of 4 over the map (light that varies over half a radian, as that of
        `envbench.laws`), and of P over phi_o: terms q > 0 come with the light's gradients.
        """
        constant = max(3 * sqrt(p.coefficients.missing_constant) + 3 * p.unevenness for p in prepared)
        rotation = max(
            4 * (pi / p.rows) ** 2 / 8 + p.coefficients.P * (2 * pi / p.directions) ** 2 / 8 for p in prepared
        )
        return Tolerance(constant_light=min(constant + 1e-3, WIDEST), rotation=min(rotation + 1e-3, WIDEST))

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [
            cls(eps=0.3, samples=4),
            cls(eps=0.1, samples=4),
            cls(eps=0.03, samples=4),
            cls(eps=0.01, samples=4),
            cls(eps=0.003, samples=4),
            cls(eps=0.01),
        ]

    def _resolution(self, lobe: LobeCoefficients) -> Resolution:
        rows = self.rows or max(ceil(self.samples * lobe.F), 16)
        even = 2 * ceil(self.samples * lobe.P / 2)
        return Resolution(lobe, rows, 1 if lobe.P == 0 else self.directions or even)
