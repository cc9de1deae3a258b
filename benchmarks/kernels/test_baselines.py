"""Baselines: what each pays for a new light and for a frame, beside the least that the same bytes or samples cost.

The bars, on two cores: nine-term irradiance of a 2048 x 1024 light within 1.5 times ducc0's own transform of it; 512
x 512 normals shaded no slower than NumPy and BLAS do it; 16 samples a point in half of what 64 take, or less.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from data_gen import environments, views
from data_gen.lobes import GGX, Lambertian
from envbench import harmonics
from envbench.environment import Environment
from envbench.geometry import Geometry, Points
from envbench.material import Material
from methods.irradiance import ORDER, Irradiance
from methods.monte_carlo import MonteCarlo
from methods.split_sum import SplitSum

Against = Callable[..., float]

SPHERE = Geometry("sphere")
WHITE = Material("white", (Lambertian(),))
METAL = Material("metal", (GGX(roughness=0.3), Lambertian(reflectance=(0.2, 0.2, 0.2))))


def queries(count: int) -> Points:
    return views.build({"kind": "uniform", "count": count}, SPHERE)[0]


def test_irradiance_relight(against: Against) -> None:
    """2048 x 1024 RGB float32, against ducc0's bare transform of the same planes to l = 2."""
    import ducc0

    radiance = np.random.default_rng(0).uniform(0, 1, (1024, 2048, 3)).astype(np.float32)
    light, method = Environment("noise", radiance), Irradiance()
    prepared = method.prepare(WHITE, SPHERE)
    planes = np.ascontiguousarray(np.moveaxis(radiance, -1, 0))
    out = np.empty((1, 6), np.complex64)

    def peer() -> None:
        for plane in planes:
            ducc0.sht.adjoint_synthesis_2d(
                map=plane[None], alm=out, spin=0, lmax=ORDER, geometry="F1", nthreads=harmonics.threads()
            )

    against(lambda: method.relight(prepared, light), peer, "ducc0's adjoint synthesis of three planes", bar=1.5)


def test_irradiance_shade(against: Against) -> None:
    """512 x 512 normals, against NumPy: ten monomials in single precision, and BLAS."""
    points, method = queries(512 * 512), Irradiance()
    light = environments.build({"kind": "captured", "name": "studio"})
    state = method.relight(method.prepare(WHITE, SPHERE), light)

    def peer() -> None:
        x, y, z = points.normal.T.astype(np.float32)
        _ = np.stack([np.ones_like(x), x, y, z, x * x, y * y, z * z, x * y, y * z, z * x]).T @ state

    against(lambda: method.shade(state, points), peer, "ten monomials and one BLAS product", bar=1.0)


def test_split_sum_relight(against: Against) -> None:
    """GGX of roughness .3 in 32 x 32 faces, against nine-term irradiance of the same light."""
    light, method, diffuse = environments.build({"kind": "captured", "name": "studio"}), SplitSum(), Irradiance()
    prepared, white = method.prepare(METAL, SPHERE), diffuse.prepare(WHITE, SPHERE)
    against(lambda: method.relight(prepared, light), lambda: diffuse.relight(white, light), "irradiance-9")


def test_split_sum_shade(against: Against) -> None:
    """512 x 512 points, against nine-term irradiance at the same."""
    points = queries(512 * 512)
    light, method, diffuse = environments.build({"kind": "captured", "name": "studio"}), SplitSum(), Irradiance()
    state = method.relight(method.prepare(METAL, SPHERE), light)
    white = diffuse.relight(diffuse.prepare(WHITE, SPHERE), light)
    against(lambda: method.shade(state, points), lambda: diffuse.shade(white, points), "irradiance-9")


def test_monte_carlo_shade(against: Against, benchmark: Any) -> None:
    """16 samples at 4096 points against 64: what does not fall with the samples is overhead."""
    points, material = queries(4096), Material("metal", METAL.lobes)
    light = environments.build({"kind": "captured", "name": "studio"})
    few, many = MonteCarlo(samples=16), MonteCarlo(samples=64)
    state = few.relight(few.prepare(material, SPHERE), light)
    ratio = against(lambda: few.shade(state, points), lambda: many.shade(state, points), "64 samples", bar=0.5)
    benchmark.extra_info["overhead"] = ratio / 0.25
