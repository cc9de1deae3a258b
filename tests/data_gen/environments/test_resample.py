"""Reduction by area: means are kept, and blocks average as blocks."""

from __future__ import annotations

import numpy as np
import pytest

from data_gen.environments.resample import downsampled
from envbench import latlong
from envbench.environment import Environment
from envbench.errors import BadInput


def random(height: int, width: int) -> Environment:
    rng = np.random.default_rng(height)
    return Environment("random", rng.lognormal(0, 3, (height, width, 3)).astype(np.float32))


@pytest.mark.parametrize(("shape", "height"), [((64, 128), 16), ((50, 99), 16), ((33, 47), 32), ((9, 4), 2)])
def test_mean_is_kept(shape: tuple[int, int], height: int) -> None:
    light = random(*shape)
    reduced = downsampled(light, height)
    assert reduced.radiance.shape == (height, max(4, round(shape[1] * height / shape[0])), 3)
    np.testing.assert_allclose(reduced.mean, light.mean, rtol=1e-6)  # float32 rounding of samples, averaged


def test_whole_blocks_are_means_by_solid_angle() -> None:
    light = random(12, 24)
    weight = np.broadcast_to(latlong.solid_angles(12, 24)[..., None], (12, 24, 3))
    blocks = (light.radiance * weight).reshape(4, 3, 8, 3, 3).sum((1, 3)) / weight.reshape(4, 3, 8, 3, 3).sum((1, 3))
    np.testing.assert_allclose(downsampled(light, 4).radiance, blocks, rtol=1e-6)


def test_never_more_rows_and_never_fewer_than_two() -> None:
    light = random(8, 16)
    assert downsampled(light, 8) is light
    assert downsampled(light, 100) is light
    with pytest.raises(BadInput, match=r">= 2 rows\. Got 1 instead"):
        downsampled(light, 1)
