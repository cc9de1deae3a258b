"""What a suite may name, put together from `data_gen`, `methods` and `references`."""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from benchmarks.studies import STUDIES
from data_gen import environments, geometry, materials, views
from envbench.catalogue import Rasteriser, Spec
from envbench.effects import EffectSettings, chosen
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, Viewer
from envbench.method import Method
from envbench.records import MaterialSheet, Study
from envbench.reference import Agreement, Reference, ReferenceSettings
from envbench.scene import Effect, Plan, Scene, told
from methods import METHODS
from references import reference
from references.effects.facts import fillable, occasions, opaque
from references.effects.kept import decided


def _suites() -> dict[str, Path]:
    return {path.stem: path for path in sorted((Path(__file__).parent / "suites").glob("*.toml"))}


@dataclass(frozen=True)
class Catalogue:
    """`envbench.catalogue.Catalogue` over the folders beside this one."""

    methods: Mapping[str, type[Method]] = field(default_factory=lambda: METHODS)
    suites: Mapping[str, Path] = field(default_factory=_suites)
    lights: Mapping[str, Spec] = field(default_factory=lambda: environments.LIGHTS)
    materials: Mapping[str, Spec] = field(default_factory=lambda: materials.MATERIALS)
    geometries: Mapping[str, Spec] = field(default_factory=lambda: geometry.GEOMETRIES)
    views: Mapping[str, Spec] = field(default_factory=lambda: views.VIEWS)
    studies: Mapping[str, Callable[[], Study]] = field(default_factory=lambda: STUDIES)

    def scene(
        self, *, name: str, light: Spec, material: Spec, geometry: Spec, view: Spec,
        effects: str | Sequence[str] | None = None,
    ) -> Scene:  # fmt: skip
        """Build a scene; its `name` is light/material/geometry/view, with the `effects` where they are given.

        Its effects are those of a list, else those that its facts call for. The last lights and queries are kept.
        """
        parts = name.removesuffix(told(effects))
        names = parts.split("/") if parts.count("/") == 3 else [parts] * 4
        environment = _LIGHTS.get(names[0], _text(light))
        brdf = materials.build(material, names[1])
        shape, points, viewer = _queries((names[2], names[3]), _text((geometry, view)))
        if brdf.transparency is not None and points.uv is None:
            raise BadInput(
                f"material '{names[1]}' has a map of transparency, and the mesh of '{names[2]}' no uv; unwrap it first."
            )
        if brdf.texture is not None:
            from data_gen import texture

            points = replace(points, modulation=texture.modulation(brdf.texture, points))
        scene = Scene(name, environment, brdf, shape, points, viewer)
        listed = None if effects is None else chosen(effects)
        return replace(scene, effects=_sensible(name, scene, None if isinstance(listed, Plan) else listed))

    def effects(
        self, scene: Scene, settings: EffectSettings, reference: ReferenceSettings, cache: Path | None
    ) -> Scene:
        """Return the scene with the effects, bounces and decisions that `settings` lead to, from `cache` if held."""
        return decided(scene, settings, reference, cache)

    def contributions(
        self, scene: Scene, settings: EffectSettings, reference: ReferenceSettings
    ) -> tuple[Scene, bytes | None]:
        """Return the scene with its decisions, every effect measured, and a PNG of what each makes of its image."""
        from benchmarks import effect_strip
        from references.effects.planner import contributions

        found = contributions(scene, settings, reference)
        return found.scene, None if scene.points.pixel is None else effect_strip.draw(found)

    def reference(self, scene: Scene, settings: ReferenceSettings, cache: Path | None) -> Reference:
        """Return ground truth, from `cache` where it holds it."""
        return reference(scene, settings, cache)

    def sheet(self, name: str, material: Spec) -> MaterialSheet:
        """Return what is known of a material by itself."""
        from benchmarks import sheets

        return sheets.sheet(name, material)

    def rasteriser(self, size: int) -> Rasteriser:
        """Return what draws pictures of `size` pixels a side; raises `CannotRun` without EGL."""
        from data_gen import rasterise

        return rasterise.Rasteriser(size)

    def agreement(self, scenes: Sequence[Scene]) -> Sequence[Agreement]:
        """Hold Mitsuba's reference against the quadrature on every convex scene."""
        from references import agreement  # brings scipy.stats, which takes a worker a second to import

        return agreement.table(scenes)


def _sensible(name: str, scene: Scene, listed: Sequence[Effect] | None) -> frozenset[Effect]:
    """Return the effects that a scene has occasion for, or those of a list, if all of it makes sense there."""
    shape = scene.geometry
    if scene.material.medium is not None and (listed is None or Effect.SUBSURFACE in listed):
        _closed(name, shape)
    if listed is None:
        return occasions(scene)
    if Effect.SUBSURFACE in listed and scene.material.medium is None:
        raise BadInput(
            f"scene '{name}': light scatters inside a translucent material, and '{scene.material.name}' has no medium; "
            f"leave {Effect.SUBSURFACE} out of its effects."
        )
    if Effect.DEFORMATION in listed and shape.pose is None:
        raise BadInput(f"scene '{name}': '{shape.name}' has no pose; leave {Effect.DEFORMATION} out of its effects.")
    if Effect.INTERREFLECTION in listed and Effect.SELF_SHADOWING not in listed:
        raise BadInput(f"scene '{name}': what sends light on hides it too; add {Effect.SELF_SHADOWING} to its effects.")
    heeded = scene if Effect.SUBSURFACE in listed else opaque(scene)
    return frozenset(listed) & occasions(heeded)


def _closed(name: str, shape: Geometry) -> None:
    """Raise `BadInput` unless light can scatter inside a shape: a closed mesh, at rest and posed."""
    if not fillable(shape):
        raise BadInput(
            f"scene '{name}': light scatters inside a closed mesh, and '{shape.name}' is none; close it, or give "
            f"the scene effects without {Effect.SUBSURFACE}."
        )


def _text(spec: Any) -> str:
    return json.dumps(spec, sort_keys=True, default=str)


@dataclass
class Lights:
    """The lights built last, at most `limit` bytes of radiance together (but always the last one)."""

    build: Callable[[str, str], Environment]
    limit: int = 256 * 2**20
    kept: OrderedDict[tuple[str, str], Environment] = field(default_factory=OrderedDict[tuple[str, str], Environment])

    def get(self, name: str, spec: str) -> Environment:
        """Return a light, built if it is not kept."""
        light = self.kept.pop((name, spec), None) or self.build(name, spec)
        self.kept[name, spec] = light
        while len(self.kept) > 1 and sum(other.radiance.nbytes for other in self.kept.values()) > self.limit:
            self.kept.popitem(last=False)
        return light


def _light(name: str, spec: str) -> Environment:
    try:
        return replace(environments.build(json.loads(spec)), name=name)
    except BadInput as error:
        raise type(error)(f"light '{name}': {error}") from None


_LIGHTS = Lights(_light)


@lru_cache(maxsize=4)
def _queries(names: tuple[str, str], spec: str) -> tuple[Geometry, Points, Viewer | None]:
    shape_spec, view_spec = json.loads(spec)
    shape = geometry.build(shape_spec, names[0])
    return (shape, *views.build(view_spec, shape, names[1]))


CATALOGUE = Catalogue()
