"""Real harmonics against SciPy's complex ones, and projections against their own quadrature."""

from __future__ import annotations

import numpy as np
from scipy import special

from envbench import latlong
from envbench.directions import to_angles, uniform
from envbench.real_harmonics import basis, project


def test_real_harmonics_are_scipys() -> None:
    view = uniform(40, np.random.default_rng(0))
    theta, phi = to_angles(view)
    got = basis(4, view)
    for l in range(5):
        for m in range(l + 1):
            Y = special.sph_harm_y(l, m, theta, phi)
            assert np.allclose(got[l * l + l + m], Y.real * (np.sqrt(2) if m else 1), atol=1e-13)
            if m:
                assert np.allclose(got[l * l + l - m], np.sqrt(2) * Y.imag, atol=1e-13)


def test_a_projection_gives_a_band_limited_map_back() -> None:
    """The bilinear function between 128 rows is the harmonic sum to h^2 / 8 of its curvature l (l + 1) = 12: 1e-3."""
    wanted = np.random.default_rng(0).normal(size=(16, 3))
    grid = latlong.grid(128, 256)
    samples = np.einsum("kn,kc->nc", basis(3, grid.reshape(-1, 3)), wanted).reshape(grid.shape)
    assert np.abs(project(samples, 3) - wanted).max() < 2e-3
