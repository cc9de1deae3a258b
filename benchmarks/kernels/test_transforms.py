"""Frequency-space kernels: SHRM's transforms beside the bare ducc0 calls that they need."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import ducc0
import numpy as np
from numpy.typing import NDArray

from data_gen.lobes import Microfacet, Phong
from envbench import harmonics
from envbench.environment import Environment
from envbench.geometry import Geometry
from envbench.material import Material
from methods.shrm import SHRM, cube
from methods.shrm.coefficients import expand

Against = Callable[..., float]


def noise(rows: int) -> Environment:
    """White noise costs a transform what any light does."""
    return Environment("noise", np.random.default_rng(0).random((rows, 2 * rows, 3)).astype(np.float32))


def channels(light: Environment, dtype: type = np.float64) -> NDArray[Any]:
    """The light as ducc0 wants it, (3, H, W): handed to the peer for nothing."""
    return np.ascontiguousarray(np.moveaxis(light.radiance.astype(dtype), -1, 0))


def analysed(planes: NDArray[Any], order: int) -> list[NDArray[Any]]:
    """The three bare analyses."""
    width = planes.shape[2]
    weights = ducc0.sht.get_gridweights("F1", planes.shape[1]) / width
    return [
        ducc0.sht.adjoint_synthesis_2d(
            map=plane[None], spin=0, lmax=order, geometry="F1", phi0=np.pi / width, ringfactor=weights,
            nthreads=harmonics.threads(),
        )
        for plane in planes
    ]  # fmt: skip


def test_shrm_relight(against: Against) -> None:
    """RGB, float64, S = 128, sigma = .1, F = 24, P = 3, against a plain loop over 3 analyses and 30 syntheses."""
    light, rows, F, P = noise(128), 128, 24, 3
    method = SHRM(order=F, view_order=P, rows=rows)
    prepared = method.prepare(Material("microfacet", (Microfacet(sigma=0.1, clipped=False),)), Geometry("sphere"))
    rho, planes = prepared.expansion.parts[0].rho[0], channels(light)
    l, _ = harmonics.degrees(F)

    def plain() -> None:
        for alm in analysed(planes, F):
            for p in range(P + 1):
                for q in range(p + 1):
                    ducc0.sht.synthesis_2d(
                        alm=alm * rho[:, p, q][l], spin=q, lmax=F, geometry="F1", ntheta=rows, nphi=2 * rows,
                        phi0=np.pi / (2 * rows), nthreads=harmonics.threads(), mode="GRAD_ONLY" if q else "STANDARD",
                    )  # fmt: skip

    against(lambda: method.relight(prepared, light), plain, "a plain loop over the bare ducc0 calls", bar=1.5)


def test_shrm_relight_from_large_light(against: Against) -> None:
    """RGB float32 light 2048 x 1024, F = 24, P = 3: bar 2 x (reading the map once + the bare ducc0 calls)."""
    light, F, P = noise(1024), 24, 3
    method = SHRM(order=F, view_order=P, precision="float32")
    prepared = method.prepare(Material("microfacet", (Microfacet(sigma=0.1, clipped=False),)), Geometry("sphere"))
    rho, planes, rows = prepared.expansion.parts[0].rho[0].astype(np.float32), channels(light, np.float32), 4 * (F + 1)
    l, _ = harmonics.degrees(F)

    def bare() -> None:
        light.radiance.sum()
        for alm in analysed(planes, F):
            for p in range(P + 1):
                for q in range(p + 1):
                    out = np.empty((2 if q else 1, rows, 2 * rows), np.float32)
                    harmonics.synthesise(alm * rho[:, p, q][l], q, F, out, harmonics.threads())

    against(lambda: method.relight(prepared, light), bare, "reading the map once, and the bare ducc0 calls", bar=2.0)


def test_full_band_relight_to_a_cube(against: Against, benchmark: Any) -> None:
    """Order 511, RGB light 1024 x 512 to six 128 x 128 faces, Phong s = 512: bar 0.15 s on two cores."""
    light, where = noise(512), cube.texels(128)
    lobe = expand(Phong(exponent=512, clipped=False), 1e-6, order=511)
    planes = channels(light, np.float32)

    def bare() -> None:
        for alm in analysed(planes, 511):
            harmonics.synthesise_at(alm, 511, where, cube.ACCURACY)

    against(lambda: cube.relight(lobe, light, where), bare, "the bare ducc0 calls, float32")
    benchmark.extra_info["seconds_bar"] = 0.15


def test_light_analysis(against: Against) -> None:
    """RGB light 2048 x 1024 to F = 24, float32, against the bare calls."""
    light = noise(1024)
    planes = channels(light, np.float32)
    against(lambda: harmonics.analyse(light.radiance, 24), lambda: analysed(planes, 24), "the three bare analyses")
