"""SHRM without maps: its coefficients summed at the points themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from envbench.directions import to_angles, to_local
from envbench.environment import Environment
from envbench.geometry import Geometry, Points
from envbench.harmonics import Coefficients, degrees
from envbench.material import Material
from envbench.method import Tolerance
from envbench.scene import Scene
from methods.shrm import maps
from methods.shrm.coefficients import LobeCoefficients
from methods.shrm.expansion import Expanded, Expansion, constant_light

MAX_TERMS = 100_000
"""(F + 1)^2 (P + 1)^2 beyond which a stored map is the better form."""
ACCURACY = {"float32": 1e-5, "float64": 1e-8}
"""What ducc0 may err by, relative to the RMS of a map."""


@dataclass(frozen=True, eq=False)
class Products:
    """Coefficients of light times lobe, (3, terms, n), in the layout of `methods.shrm.maps.products`."""

    lobe: LobeCoefficients
    alm: Coefficients


@dataclass(frozen=True, eq=False)
class QuadraticForm:
    """B = h^T M h with h = (x, y, z, 1) the central direction: `matrices` (3, 4, 4)."""

    lobe: LobeCoefficients
    matrices: NDArray[np.floating]


@dataclass(frozen=True)
class SHRMCoefficients(Expansion):
    """SHRM as pure coefficients: no map lies between, so nothing is lost by lookup; each point sums all terms.

    A radially symmetric lobe with F <= 2 is a quadratic form of its central direction: 9 terms for Lambertian ones.
    """

    name = "shrm-coefficients"
    summary = "spherical harmonic reflection coefficients, summed at the points; a 4 x 4 quadratic form where F <= 2"
    source = (
        "Ramamoorthi and Hanrahan 2002, eqs. 5 and 6; the quadratic form: Ramamoorthi and Hanrahan 2001, eqs. 11 and 12"
    )

    def declines(self, scene: Scene) -> str | None:
        reason = super().declines(scene)
        if reason is None:
            sums = self.expand(scene.material).sums
            terms = max((c.F + 1) ** 2 * maps.planes(c.P, c.F, c.Q) for c in sums)
            if terms > MAX_TERMS:
                return (
                    f"a sum of {terms} terms at every point is more than the {MAX_TERMS} that make sense: store a map"
                )
        return reason

    def prepare(self, material: Material, geometry: Geometry) -> Expanded:
        return self.expand(material)

    def summed(self, lobes: Sequence[LobeCoefficients]) -> Sequence[LobeCoefficients]:
        """Sum lobes about one centre where that takes fewer terms."""
        one, *_ = super().summed(lobes)
        return [one] if _terms(one) <= sum(map(_terms, lobes)) else lobes

    def expansion(self, prepared: Expanded) -> Expanded:
        return prepared

    def relight(self, prepared: Expanded, environment: Environment) -> tuple[Products | QuadraticForm, ...]:
        lights = prepared.light(environment.radiance.astype(self.precision, copy=False))
        return tuple(
            QuadraticForm(c, quadratic_form(alm[:, 0], c.F)) if c.radial and c.F <= 2 else Products(c, alm)
            for c, light in zip(prepared.sums, lights, strict=True)
            for alm in (maps.products(c, light),)
        )

    def shade(self, framed: tuple[Products | QuadraticForm, ...], points: Points) -> NDArray[np.floating]:
        out = np.zeros((len(points), 3))
        for part in framed:
            centre = points.central(part.lobe.centre)
            if isinstance(part, QuadraticForm):
                h = np.concatenate([centre, np.ones((len(centre), 1))], axis=1)
                out += np.stack([((h @ M) * h).sum(1) for M in part.matrices], axis=1)
            else:
                where = np.stack(to_angles(centre), axis=-1)
                planes = maps.at(part.lobe, part.alm, where, ACCURACY[self.precision])
                out += np.einsum("kn,ckn->nc", maps.basis(part.lobe, to_local(points.view, centre)), planes)
        return out

    def tolerance(self, prepared: Expanded) -> Tolerance:
        """No lookup: a turn meets rounding and the light's own samples alone; integrals: `constant_light`."""
        return Tolerance(linearity=1e-5, constant_light=constant_light(prepared), rotation=1e-3)

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [cls(eps=eps) for eps in (0.3, 0.1, 0.03, 0.01, 0.003)]


def quadratic_form(alm: Coefficients, order: int) -> NDArray[np.floating]:
    """Return M (3, 4, 4) of real functions with coefficients `alm` (3, n) to `order` <= 2 (RH 2001, eq. 12)."""
    l, m = degrees(order)
    a: dict[tuple[int, int], Any] = {
        (i, j): alm[:, k] for k, (i, j) in enumerate(zip(l.tolist(), m.tolist(), strict=True))
    }
    none = np.zeros(len(alm), alm.dtype)
    M = np.zeros((len(alm), 4, 4), alm.real.dtype)
    # f = sum a_l0 Y_l0 + 2 Re(a_lm Y_lm); Y_11 = -k1 (x + i y), Y_21 = -k2 z (x + i y), Y_22 = k2 (x + i y)^2 / 2
    k1, k2 = np.sqrt(3 / (8 * np.pi)), np.sqrt(15 / (8 * np.pi))
    one, two, three = a.get((1, 1), none), a.get((2, 1), none), a.get((2, 2), none)
    flat, zonal = a.get((1, 0), none).real, a.get((2, 0), none).real * np.sqrt(5 / (16 * np.pi))
    M[:, 0, 0], M[:, 1, 1] = k2 * three.real, -k2 * three.real
    M[:, 0, 1] = M[:, 1, 0] = -k2 * three.imag
    M[:, 0, 2] = M[:, 2, 0] = -k2 * two.real
    M[:, 1, 2] = M[:, 2, 1] = k2 * two.imag
    M[:, 0, 3] = M[:, 3, 0] = -k1 * one.real
    M[:, 1, 3] = M[:, 3, 1] = k1 * one.imag
    M[:, 2, 3] = M[:, 3, 2] = flat * np.sqrt(3 / (16 * np.pi))
    M[:, 2, 2] = 3 * zonal
    M[:, 3, 3] = a[0, 0].real / np.sqrt(4 * np.pi) - zonal
    return M


def _terms(lobe: LobeCoefficients) -> int:
    return (lobe.F + 1) ** 2 * maps.planes(lobe.P, lobe.F, lobe.Q)
