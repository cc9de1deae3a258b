"""Light that scatters inside a shape, by Mitsuba's volumetric path tracer `volpath`.

What leaves a point of a translucent shape, averaged over directions by the cosine, is its diffuse exit radiance. Each
estimate follows one path backwards: it starts just inside, against a direction drawn by the cosine about N, and
`volpath` does the rest. The medium has the refractive index of what is outside, so that paths pass the surface straight
on and may come in again: the shadows and bounces of the shape are in them.

Light that comes straight through, `volpath` would find by chance alone, as what is at the start is no event at which it
samples the light. So it leaves that out (`hide_emitters`), and the light is sampled here, dimmed by the way inside.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from data_gen.geometry import mitsuba_mesh
from data_gen.mitsuba_estimator import Estimator, Light, seeded
from data_gen.mitsuba_light import emitter
from data_gen.mitsuba_paths import Draws
from envbench import llvm
from envbench.errors import BadInput

SAMPLER = "independent"
"""Of Mitsuba's: a path takes as many numbers as it likes."""
MOST_EVENTS, ALL_FOLLOWED = 20_000, 256
"""Of one path, and how many before Russian roulette begins: earlier, in a white medium, it would only add noise."""


@dataclass(frozen=True, eq=False)
class Scattering(Estimator):
    """Radiance that leaves a translucent shape: the lobes' reflectance times what comes out of its medium.

    Carried (`Surface.carried`): paths are followed in the shape at rest, under the light turned back for each point.
    """

    sample_lobes: bool = False

    @property
    def order(self) -> float:
        return 0.5

    def _sampler(self, mi: Any, samples: int, seed: Any, lanes: int, kind: int, many: int = 1) -> Any:
        return seeded(mi, SAMPLER, samples, seed, lanes)

    @property
    def rays(self) -> int:
        """Paths followed for each sample, whatever rays they take."""
        return len(self.environment.parts)

    @cached_property
    def shape(self) -> Any:
        """Give the closed mesh, filled, as a `mi.Mesh`."""
        mesh, medium = self.surface.occluder, self.surface.material.medium
        if mesh is None or medium is None:
            raise BadInput(f"light scatters in a medium that fills a mesh; '{self.surface.material.name}' lacks it.")
        mi = llvm.mitsuba(self.surface.variant)
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict({"type": "null"})
        properties["interior"] = mi.load_dict({
            "type": "homogeneous",
            "albedo": medium.albedo,
            "sigma_t": 1 / medium.mean_free_path,
            "phase": {"type": "isotropic"},
        })  # fmt: skip
        return mitsuba_mesh(mi, mesh, properties)

    @cached_property
    def integrator(self) -> Any:
        """Give the path tracer."""
        mi = llvm.mitsuba(self.surface.variant)
        settings = {"max_depth": MOST_EVENTS, "rr_depth": ALL_FOLLOWED, "hide_emitters": True}
        return mi.load_dict({"type": "volpath", **settings})

    @cached_property
    def _lights(self) -> tuple[Any, ...]:
        """The parts of the light, each turned for each path where shadows are carried."""
        mi = llvm.mitsuba(self.surface.variant)
        lights = (mi.load_dict(emitter(part)) for _, part in self.environment.parts)
        return tuple(_turning(mi, light) if self.surface.carried else light for light in lights)

    @cached_property
    def _scenes(self) -> tuple[tuple[float, Any], ...]:
        mi = llvm.mitsuba(self.surface.variant)
        return tuple(
            (sign, mi.load_dict({"type": "scene", "light": light, "shape": self.shape}))
            for (sign, _), light in zip(self.environment.parts, self._lights, strict=True)
        )

    def _by_bounce(
        self, mi: Any, si: Any, place: Any, draws: list[Draws], beside: tuple[Light, ...] | None = None
    ) -> list[Any]:
        """Return one estimate: bounces are those of the paths, and nothing is told apart."""
        import drjit as dr

        assert beside is None
        time = mi.Float(0)
        if place.rotation is not None:
            dr.eval(*place.rotation)
            for light in self._lights:
                light.rotation = place.rotation
            if not self.surface.variant.startswith("scalar"):
                time = mi.Float(dr.arange(mi.UInt32, dr.width(place.rotation[0])))
        start = mi.Point3f(place.position - place.lift * place.geometric)
        total = mi.Color3f(0)
        for (sign, scene), (sampler, *_) in zip(self._scenes, draws, strict=True):
            outwards = mi.Frame3f(place.normal).to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
            ray = mi.Ray3f(start, -outwards, time)
            met = scene.ray_intersect(ray)
            outside = met.is_valid() & (dr.dot(met.n, ray.d) < 0)  # as beside a sharp edge: taken to where it enters
            entered = mi.RayDifferential3f(dr.select(outside, met.spawn_ray(ray.d).o, ray.o), ray.d, time)
            scattered, _, _ = self.integrator.sample(
                scene, sampler, entered, self.shape.interior_medium(), met.is_valid()
            )
            straight = self._straight(mi, scene, ray, -place.normal, sampler)
            total += sign * (dr.select(met.is_valid(), scattered, 0) + straight)
            dr.eval(total)  # the parts share one kernel
        reflectance = np.sum([lobe.reflectance for lobe in self.surface.material.lobes], axis=0)
        return [total * mi.Color3f(*(float(r) for r in reflectance))]

    def _straight(self, mi: Any, scene: Any, ray: Any, inwards: Any, sampler: Any) -> Any:
        """Return an estimate of the light that comes to where the ray starts without an event.

        From one direction of the light, and that of the ray, drawn by the cosine about `inwards`: weighed by the
        balance heuristic.
        """
        import drjit as dr

        emission = scene.environment()
        it = dr.zeros(mi.SurfaceInteraction3f)
        it.p, it.time, it.wi = ray.o, ray.time, -ray.d
        ds, light = emission.sample_direction(it, sampler.next_2d())
        cosine = dr.maximum(dr.dot(inwards, ds.d), 0) / np.pi
        share = dr.select(ds.pdf > 0, cosine / (ds.pdf + cosine), 0)  # light is divided by its density already
        total = light * ds.pdf * share * self._left(mi, scene, mi.Ray3f(ray.o, ds.d, ray.time), share > 0)
        ds = mi.DirectionSample3f()
        ds.d = ray.d
        cosine = dr.maximum(dr.dot(inwards, ray.d), 0) / np.pi
        share = cosine / dr.maximum(cosine + emission.pdf_direction(it, ds), 1e-30)
        return total + emission.eval(it) * share * self._left(mi, scene, ray, share > 0)

    def _left(self, mi: Any, scene: Any, ray: Any, active: Any) -> Any:
        """Return how much of the light along a ray comes through the shape, in which it starts."""
        import drjit as dr

        assert self.surface.material.medium is not None
        return dr.exp(-self._way_inside(mi, scene, ray, active) / self.surface.material.medium.mean_free_path)

    def _way_inside(self, mi: Any, scene: Any, ray: Any, active: Any) -> Any:
        """Return the length of a ray that lies within the shape, in which it starts."""
        import drjit as dr

        def body(ray: Any, way: Any, active: Any) -> Any:
            si = scene.ray_intersect(ray, active)
            active = active & si.is_valid()
            way = way + dr.select(active & (dr.dot(si.n, ray.d) > 0), si.t, 0)
            return dr.select(active, si.spawn_ray(ray.d), ray), way, active

        return dr.while_loop(
            state=(ray, mi.Float(0), mi.Bool(active)),
            cond=lambda _ray, _way, active: active,
            body=body,
            labels=("ray", "way", "active"),
        )[1]


def _turning(mi: Any, light: Any) -> Any:
    """Return an environment that is turned another way for every path: from s comes what `light` has at R s.

    Its `rotation` holds the rows of R, that of path k at place k; k is the time that the rays of a path carry along.
    """
    import drjit as dr

    class Turning(mi.Emitter):
        rotation: Any = None

        def __init__(self) -> None:
            super().__init__(mi.Properties())
            self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.SpatiallyVarying

        def set_scene(self, scene: Any) -> None:
            light.set_scene(scene)

        def bbox(self) -> Any:
            return light.bbox()

        def eval(self, si: Any, active: Any = True) -> Any:
            seen = dr.zeros(mi.SurfaceInteraction3f)
            seen.wi = self._turned(si, si.wi)
            return light.eval(seen, active)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> Any:
            ds, weight = light.sample_direction(it, sample, active)
            x, y, z = self._rows(it)
            ds.d = x * ds.d.x + y * ds.d.y + z * ds.d.z
            ds.p, ds.n = it.p + ds.d * ds.dist, mi.Normal3f(-ds.d)
            return ds, weight

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return light.pdf_direction(it, self._there(it, ds), active)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return light.eval_direction(it, self._there(it, ds), active)

        def to_string(self) -> str:
            return "Turning"

        def _there(self, it: Any, ds: Any) -> Any:
            out = mi.DirectionSample3f(ds)
            out.d = self._turned(it, ds.d)
            return out

        def _turned(self, it: Any, v: Any) -> Any:
            return mi.Vector3f(*(dr.dot(row, v) for row in self._rows(it)))

        def _rows(self, it: Any) -> Any:
            if not dr.is_array_v(it.time):
                return self.rotation
            return [dr.gather(mi.Vector3f, row, mi.UInt32(it.time)) for row in self.rotation]

    return Turning()
