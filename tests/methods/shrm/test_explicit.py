"""Conversions: equal to the SHRM where they must be, to direct integration within the missing energy, and undone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from data_gen.lobes import Lambertian, Microfacet, Phong
from envbench import harmonics, latlong
from envbench.directions import Array, from_angles, to_angles, uniform
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.material import Centre, Lobe
from methods.angular.prefilter import prefilter
from methods.shrm import explicit, maps
from methods.shrm.coefficients import LobeCoefficients, expand

SINGLE = 1e-5
ROWS = 12


class AboutTheNormal(Microfacet):
    """A lobe that varies with the view about N: any function of C.L, C.V and V.L will do."""

    centre = Centre.NORMAL


def lamps(rows: int) -> Environment:
    """One bright pixel for each channel: under one lamp, of all degrees, energy errors are those of the BRDF."""
    theta, phi = to_angles(uniform(3, np.random.default_rng(0)))
    radiance = np.zeros((rows, 2 * rows, 3), np.float32)
    row = (theta * rows / np.pi).astype(int)
    radiance[row, (phi * rows / np.pi).astype(int), range(3)] = 1 / latlong.solid_angles(rows, 2 * rows)[row, 0]
    return Environment("lamps", radiance)


def converted(lobe: Lobe, light: Environment, rows: int, P: int, F: int = 20) -> tuple[LobeCoefficients, Array]:
    coefficients = expand(lobe, 0.01, order=F, view_order=P)
    spectrum = harmonics.analyse(light.radiance.astype(np.float64), F)
    return coefficients, np.asarray(maps.synthesise(coefficients, spectrum, rows), np.float64)


def directions(kind: Centre, rows: int, T: int) -> tuple[Array, Array, Array]:
    """C, V and N of a table, (rows, 2 rows, T, T, 3) each: R(alpha, beta) turns the local ones."""
    a, b, theta, phi = np.meshgrid(
        *latlong.angles(rows, 2 * rows), explicit.polar_nodes(kind, T), 2 * np.pi * np.arange(T) / T, indexing="ij"
    )

    def turned(polar: Array) -> Array:
        x, y, z = np.moveaxis(from_angles(polar, phi), -1, 0)
        x, z = np.cos(a) * x + np.sin(a) * z, np.cos(a) * z - np.sin(a) * x
        return np.stack([np.cos(b) * x - np.sin(b) * y, np.sin(b) * x + np.cos(b) * y, z], -1)

    return from_angles(a, b), turned(theta), turned(theta / 2 if kind is Centre.REFLECTION else 0 * theta)


def read(lobe: LobeCoefficients, planes: Array, centre: Array, view: Array) -> Array:
    """The SHRM itself, looked up at its own samples, where the interpolation is exact."""
    shape = centre.shape
    return np.asarray(maps.read(lobe, planes, centre.reshape(-1, 3), view.reshape(-1, 3)), float).reshape(shape)


@pytest.mark.parametrize("lobe", [Microfacet(), AboutTheNormal(), Lambertian(reflectance=(0.5, 0.2, 0))], ids=repr)
def test_a_table_is_the_shrm_at_its_directions(lobe: Lobe) -> None:
    T = 1 if lobe.radially_symmetric else 6
    coefficients, planes = converted(lobe, lamps(64), ROWS, 3)
    table = explicit.views(coefficients, planes, T)
    assert (table.shape, table.dtype) == ((ROWS, 2 * ROWS, T, T, 3), np.float32)
    centre, view, _ = directions(lobe.centre, ROWS, T)
    truth = read(coefficients, planes, centre, view)
    np.testing.assert_allclose(table, truth, atol=SINGLE * np.abs(truth).max())


def test_maps_for_fixed_views_are_the_shrm_at_them() -> None:
    coefficients, planes = converted(Microfacet(), lamps(64), ROWS, 3)
    directions = np.concatenate([uniform(4, np.random.default_rng(1)), [[0, 0, 1], [0, 0, -1]]])
    seen = explicit.seen_from(coefficients, planes, directions)
    centre = latlong.grid(ROWS, 2 * ROWS)
    for view, image in zip(directions, seen, strict=True):
        truth = read(coefficients, planes, centre, np.broadcast_to(view, centre.shape))
        np.testing.assert_allclose(np.moveaxis(image, 0, -1), truth, atol=1e-12 * np.abs(truth).max())


def test_the_3d_texture_is_the_mean_over_azimuth() -> None:
    coefficients, planes = converted(Microfacet(), lamps(64), ROWS, 4)
    T = 10  # azimuths, more than 2 P: their mean is exact
    table = explicit.views(coefficients, planes, T)
    texture = explicit.averaged(coefficients, planes, explicit.polar_nodes(Centre.REFLECTION, T))
    assert texture.shape == (3, T, ROWS, 2 * ROWS)
    mean = np.moveaxis(table.mean(3), (3, 2), (0, 1))
    np.testing.assert_allclose(texture, mean, atol=SINGLE * np.abs(mean).max())


@pytest.mark.parametrize("P", [0, 1, 3, 6])
def test_a_fit_undoes_a_table(P: int) -> None:
    coefficients, planes = converted(Microfacet(), lamps(64), ROWS, P)
    back = explicit.fit(coefficients, explicit.views(coefficients, planes, 2 * P + 2))
    np.testing.assert_allclose(back, planes, atol=10 * SINGLE * np.abs(planes).max())


def test_a_fit_from_the_upper_hemisphere_gives_the_same_table() -> None:
    """About N no view comes from below: the planes are not unique, what they say of the views is."""
    coefficients, planes = converted(AboutTheNormal(), lamps(64), ROWS, 3)
    table = explicit.views(coefficients, planes, 10)
    again = explicit.views(coefficients, explicit.fit(coefficients, table), 10)
    np.testing.assert_allclose(again, table, atol=100 * SINGLE * table.max())


def test_too_few_views_for_a_fit_are_refused() -> None:
    coefficients, planes = converted(Microfacet(), lamps(64), ROWS, 3)
    with pytest.raises(BadInput, match="6 x 6 views cannot give order P = 3: lower P or take T >= 7"):
        explicit.fit(coefficients, explicit.views(coefficients, planes, 6))


def energy(values: NDArray[np.floating], T: int) -> float:
    """The mean square over central directions and views, by solid angle."""
    rows, columns = values.shape[:2]
    bands = np.sin(explicit.polar_nodes(Centre.REFLECTION, T))
    weight = latlong.solid_angles(rows, columns)[:, :, None, None, None] * bands[:, None, None]
    return float((values.astype(float) ** 2 * weight).sum())


@pytest.mark.parametrize(
    ("lobe", "P"),
    [(Microfacet(sigma=0.3), 1), (Microfacet(sigma=0.3), 2), (Microfacet(sigma=0.4, clipped=False), 3)],
    ids=repr,
)
def test_a_table_is_the_directly_integrated_one_but_for_the_missing_energy(lobe: Lobe, P: int) -> None:
    """Under one lamp the integral is the lobe itself.

    The pixels are bilinear hats of d = pi / 96: that damps the energy of degree l = 20, beyond which these lobes hold
    nothing, by (20 d)^2 / 6 = 7 %. The 12 x 12 views sample the rest to as much again.
    """
    light, rows, T = lamps(96), 24, 12
    coefficients, planes = converted(lobe, light, rows, P)
    table = explicit.views(coefficients, planes, T)
    centre, view, normal = (np.moveaxis(d, -1, 0) for d in directions(lobe.centre, rows, T))
    direct = np.zeros_like(table)
    for channel in range(3):
        lamp = latlong.grid(96, 192)[np.unravel_index(light.radiance[..., channel].argmax(), (96, 192))]
        direct[..., channel] = lobe.evaluate(lamp[:, None, None, None, None], view, centre, normal)[channel]
    lost = energy(table - direct, T) / energy(direct, T)
    assert lost == pytest.approx(coefficients.missing, rel=0.15)


def test_a_directly_integrated_table_gives_the_shrm() -> None:
    """Fitted planes are the SHRM's own within what the orders beyond P alias: the root of their energy."""
    lobe, light, rows, T, P = Phong(exponent=8), lamps(24), 8, 12, 2
    coefficients, planes = converted(lobe, light, rows, P)
    table = prefilter(light.radiance, lobe, (rows, 2 * rows), 1e-4, T)
    fitted = explicit.fit(coefficients, table)
    error = np.sqrt(np.sum((fitted - planes) ** 2) / np.sum(planes**2))
    assert error < np.sqrt(coefficients.missing)
