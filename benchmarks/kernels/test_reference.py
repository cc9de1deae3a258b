"""Ground truth: 4096 queries to a noise floor of 1e-3, and the cost of a sample beside Mitsuba's own integrator."""

from __future__ import annotations

from typing import Any

from data_gen import environments, materials, views
from envbench.geometry import Geometry
from envbench.reference import ReferenceSettings
from envbench.scene import Scene
from references import reference

SECONDS_BAR = 10.0


def test_reference_to_a_floor(benchmark: Any) -> None:
    """Microfacet sigma = .2, the sunlit esplanade, no cache: bar 10 s on two cores, kernel compilation included."""
    geometry = Geometry("sphere")
    light = environments.build({"kind": "captured", "name": "esplanade"})
    material = materials.build({"kind": "microfacet", "sigma": 0.2}, "microfacet")
    points, viewer = views.build({"kind": "uniform", "count": 4096}, geometry)
    scene = Scene("bar", light, material, geometry, points, viewer)
    truth = benchmark.pedantic(lambda: reference(scene, ReferenceSettings(), None), rounds=3, warmup_rounds=0)
    seconds = benchmark.stats.stats.median
    samples = truth.samples * len(truth.replicates) * len(points)
    benchmark.extra_info.update(
        floor=truth.floor, samples_of_the_last_step=samples, seconds_over_bar=seconds / SECONDS_BAR
    )
