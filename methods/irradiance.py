"""Nine-term irradiance (Ramamoorthi and Hanrahan 2001): diffuse light as one quadratic form of the normal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.lobes import Lambertian
from envbench import harmonics, llvm
from envbench.directions import Array
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.material import Material
from envbench.method import Method, Tolerance
from envbench.scene import Effect, Scene

ORDER = 2
_LAST = 30
"""Degree up to which the missing energy is summed; what lies beyond holds 1e-5 of the clamped cosine's."""


@dataclass(frozen=True)
class Irradiance(Method):
    """Keep the nine spherical harmonic coefficients of the light to l = 2, as n^T M n with n = (x, y, z, 1).

    The clamped cosine has 99.2 % of its energy there; the rest, l = 4, 6, 8 ..., is lost, and what is left may ring to
    slightly negative values opposite a lamp. M is symmetric: ten numbers a channel.
    """

    name = "irradiance-9"
    summary = "stores nine spherical harmonics of the light as a quadratic form of the normal; Lambertian lobes only"
    source = "Ramamoorthi and Hanrahan 2001, An Efficient Representation for Irradiance Environment Maps, eqs. 11, 12"
    simulates = frozenset[Effect]()

    def declines(self, scene: Scene) -> str | None:
        if not all(isinstance(lobe, Lambertian) for lobe in scene.material.lobes):
            return "holds Lambertian lobes only"
        return None

    def prepare(self, material: Material, geometry: Geometry) -> NDArray[np.float64]:
        """Return the reflectance (3,), summed over the lobes."""
        if not all(isinstance(lobe, Lambertian) for lobe in material.lobes):
            raise BadInput(f"irradiance-9 holds Lambertian lobes only; material '{material.name}' has another.")
        return np.sum([lobe.reflectance for lobe in material.lobes], axis=0)

    def relight(self, prepared: NDArray[np.float64], environment: Environment) -> NDArray[np.float32]:
        """Return the quadratic forms of the radiance, (10, 3): see `quadratic_form`."""
        return quadratic_form(harmonics.analyse(environment.radiance, ORDER), prepared)

    def shade(self, framed: NDArray[np.float32], points: Points) -> NDArray[np.floating]:
        """Evaluate them at the normals, in one kernel."""
        return finished(reflected(framed, vectors(points.normal)))

    def predictions(self, prepared: NDArray[np.float64], environment: Environment) -> dict[str, float]:
        """Energy of the clamped cosine beyond l = 2, alone and weighed by the light's power in each band.

        The second is exact for uniform normals: the bands are orthogonal there.
        """
        l, m = harmonics.degrees(_LAST)
        light = harmonics.analyse(environment.radiance, _LAST) * prepared[:, None]
        power = np.bincount(l, (np.where(m > 0, 2, 1) * np.abs(light) ** 2).sum(0), _LAST + 1)
        lobe = clamped_cosine(_LAST) ** 2
        return {
            "captured BRDF energy": _beyond(lobe * (2 * np.arange(_LAST + 1) + 1)),
            "light's power per band": _beyond(lobe * power),
        }

    def tolerance(self, prepared: NDArray[np.float64]) -> Tolerance:
        """Single precision in transform and evaluation; a band-limited form turns with its light exactly.

        So a turn shows the sampling of the light alone, the margin that `envbench.laws` states for its lamps (3e-4).
        """
        return Tolerance(linearity=1e-5, constant_light=1e-5, rotation=3e-4)


def clamped_cosine(order: int) -> NDArray[np.float64]:
    """Return A_l / pi = 2 int_0^1 x P_l(x) dx for l = 0 ... order: 1, 2/3, 1/4, 0, -1/24 ... (RH 2001, eq. 8)."""
    x, weight = np.polynomial.legendre.leggauss(order // 2 + 2)
    x, weight = (x + 1) / 2, weight / 2
    return 2 * (weight * x) @ np.polynomial.legendre.legvander(x, order)


def quadratic_form(light: NDArray[np.complexfloating], reflectance: NDArray[np.float64]) -> NDArray[np.float32]:
    """Turn the light's coefficients to l = 2 into those of radiance as a polynomial of the normal (RH 2001, eq. 12).

    Parameters
    ----------
    light : (3, 6) complex
        L_lm as `envbench.harmonics` has them.
    reflectance : (3,)

    Returns
    -------
    (10, 3) float32
        Of 1, x, y, z, xx, yy, zz, xy, yz, zx: the entries of M, those off its diagonal doubled.
    """
    a0, a1, a2 = clamped_cosine(ORDER)
    l00, l10, l20, l11, l21, l22 = light.astype(np.complex128).T
    # sqrt((2 l + 1) / (4 pi) ...) of Y_lm (`scipy.special.sph_harm_y`); terms of m > 0 count twice, for those of m < 0
    y00, y10, y20 = a0 * np.sqrt(1 / (4 * np.pi)), a1 * np.sqrt(3 / (4 * np.pi)), a2 * np.sqrt(5 / (16 * np.pi))
    y11, y21, y22 = -y10 * np.sqrt(2), -y20 * 2 * np.sqrt(6), y20 * np.sqrt(6)
    form = [
        y00 * l00.real - y20 * l20.real,
        y11 * l11.real,
        -y11 * l11.imag,
        y10 * l10.real,
        y22 * l22.real,
        -y22 * l22.real,
        3 * y20 * l20.real,
        -2 * y22 * l22.imag,
        -y21 * l21.imag,
        y21 * l21.real,
    ]
    return (np.array(form) * reflectance).astype(np.float32)


def reflected(form: NDArray[np.float32], normal: Any) -> Any:
    """Evaluate a quadratic form (10, 3) at unit normals; both normals and result are Dr.Jit's ``Array3f``."""
    import drjit as dr
    from drjit.llvm import Array3f, Float

    # opaque: the kernel takes them as arguments, and is not compiled anew for another light
    one, x, y, z, xx, yy, zz, xy, yz, zx = (Array3f(*(dr.opaque(Float, float(c)) for c in row)) for row in form)
    return (
        one
        + normal.x * (x + normal.x * xx + normal.y * xy)
        + normal.y * (y + normal.y * yy + normal.z * yz)
        + normal.z * (z + normal.z * zz + normal.x * zx)
    )


def vectors(values: Array) -> Any:
    """Return vectors (n, 3) as Dr.Jit's ``Array3f``, in single precision."""
    llvm.find()
    from drjit.llvm import Array3f

    return Array3f(values.T.astype(np.float32, order="C"))


def finished(value: Any) -> NDArray[np.float32]:
    """Return an ``Array3f``, computed, as (n, 3): planes seen as columns, since interleaving them takes longer."""
    import drjit as dr

    dr.eval(value)
    dr.sync_thread()
    return np.array(value).T


def _beyond(energy: NDArray[np.floating]) -> float:
    total = float(energy.sum())
    return float(energy[ORDER + 1 :].sum()) / total if total > 0 else 0.0
