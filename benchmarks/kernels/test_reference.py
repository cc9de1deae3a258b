"""Ground truth: 4096 queries to a noise floor of 1e-3, and the cost of a sample beside Mitsuba's own integrator."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from data_gen import environments, materials, views
from data_gen.mitsuba_bsdf import bsdf
from data_gen.mitsuba_estimator import SAMPLER
from data_gen.mitsuba_light import emitter
from envbench import llvm
from envbench.geometry import Geometry
from envbench.reference import ReferenceSettings
from envbench.scene import Scene
from references import reference
from references.estimators import estimator_for

Against = Callable[..., float]

SECONDS_BAR = 10.0
SAMPLES = 1024


def scene() -> Scene:
    """Microfacet sigma = .2 under the sunlit esplanade, 4096 uniform (R, V)."""
    geometry = Geometry("sphere")
    light = environments.build({"kind": "captured", "name": "esplanade"})
    material = materials.build({"kind": "microfacet", "sigma": 0.2}, "microfacet")
    points, viewer = views.build({"kind": "uniform", "count": 4096}, geometry)
    return Scene("bar", light, material, geometry, points, viewer)


def test_reference_to_a_floor(benchmark: Any) -> None:
    """Microfacet sigma = .2, the sunlit esplanade, no cache: bar 10 s on two cores, kernel compilation included."""
    made = scene()
    truth = benchmark.pedantic(lambda: reference(made, ReferenceSettings(), None), rounds=3, warmup_rounds=0)
    seconds = benchmark.stats.stats.median
    samples = truth.samples * len(truth.replicates) * len(made.points)
    benchmark.extra_info.update(
        floor=truth.floor, samples_of_the_last_step=samples, seconds_over_bar=seconds / SECONDS_BAR
    )


def test_samples_beside_mitsubas_direct(against: Against) -> None:
    """1,024 samples at each of 4096 queries, against Mitsuba's own `direct` on rays that meet a sphere there."""
    made = scene()
    estimator = estimator_for(made, ReferenceSettings())
    mi = llvm.mitsuba()
    parts = {"type": "scene", "light": emitter(made.environment)}
    sphere = {"type": "sphere", "bsdf": bsdf(made.material)}
    world, direct = mi.load_dict(parts | {"sphere": sphere}), mi.load_dict({"type": "direct"})
    points = made.points
    count = len(points) * SAMPLES

    def peer() -> None:
        import drjit as dr

        sampler = mi.load_dict({"type": SAMPLER, "sample_count": SAMPLES})
        sampler.set_samples_per_wavefront(SAMPLES)
        sampler.seed(0, count)
        at = dr.arange(mi.UInt32, count) // SAMPLES
        start, view = (
            dr.gather(mi.Point3f, mi.Point3f(np.ascontiguousarray(a.T, np.float32)), at)
            for a in (points.position + points.view, points.view)
        )
        radiance = direct.sample(world, sampler, mi.RayDifferential3f(mi.Ray3f(start, -mi.Vector3f(view))))[0]
        dr.eval(dr.block_sum(radiance.x, SAMPLES))
        dr.sync_thread()

    seed = np.random.SeedSequence(0)
    against(
        lambda: estimator.replicate(points, SAMPLES, seed), peer, "Mitsuba's direct, with its visibility rays", rounds=7
    )
