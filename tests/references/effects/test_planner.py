"""Plans of small scenes whose answer is known."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from benchmarks.catalogue import CATALOGUE
from envbench.effects import EffectSettings, warnings
from envbench.reference import ReferenceSettings
from envbench.scene import Basis, Decision, Effect, Plan, Scene
from references.effects import planner
from references.effects.facts import facts
from references.effects.kept import decided
from references.effects.planner import contributions, planned
from references.effects.probe import Bound, Variant
from references.effects.variants import Variants
from references.mitsuba_direct import render

SKY = {"kind": "projected", "of": "studio", "order": 4}
ABOVE = {"kind": "image", "size": 32, "direction": [0.2, -0.7, 0.9]}
REFERENCE = ReferenceSettings(floor=1e-2, bounces=2)
AUTO = EffectSettings(tolerance=0.01)
S, B, D = Effect.SELF_SHADOWING, Effect.INTERREFLECTION, Effect.DEFORMATION


def scene(reflectance: float = 0.8, height: float = 0.2, pose: Any = None, **parts: Any) -> Scene:
    patch = {"kind": "patch", "texture": "waffle", "tiles": 2, "size": 1.0, "resolution": 33, "height": height}
    tables: dict[str, Any] = {
        "light": SKY,
        "material": {"kind": "lambertian", "reflectance": [reflectance] * 3},
        "geometry": patch if pose is None else patch | {"pose": pose},
        "view": ABOVE,
    }
    return CATALOGUE.scene(name="test", **(tables | parts))


def by_effect(made: Scene) -> dict[Effect, Decision]:
    return {d.effect: d for d in made.decisions}


@pytest.mark.parametrize(
    ("reflectance", "height", "expected"),
    [(0.8, 0.2, {S, B}), (0.01, 0.2, {S}), (0.8, 0.0005, set[Effect]())],
    ids=["deep and bright", "deep and dark", "shallow"],
)
def test_simulates_what_matters(mi: ModuleType, reflectance: float, height: float, expected: set[Effect]) -> None:
    made = planned(scene(reflectance, height), AUTO, REFERENCE)
    assert made.effects == expected
    told = by_effect(made)
    assert set(told) == set(Effect)
    assert made.bounces == told[B].bounces
    for effect in (S, B):
        found = told[effect]
        assert found.basis is Basis.PROBE
        assert found.low <= found.contribution <= found.high
        assert found.low > AUTO.limit if found.simulated else found.high < AUTO.limit
        assert found.saved == (0 if found.simulated and effect is S else found.saved)
        assert found.seconds > 0


def test_the_plan_renders_as_all_effects_do(mi: ModuleType) -> None:
    """Within tolerance and three noise floors, with the bounces that the plan says."""
    for reflectance in (0.02, 0.4):
        full, made = (planned(scene(reflectance), replace(AUTO, plan=p), REFERENCE) for p in (Plan.FACTS, Plan.AUTO))
        a, b = (render(s, REFERENCE) for s in (full, made))
        off = np.sqrt(np.average(((a.mean - b.mean) ** 2).mean(-1), weights=a.weight)) / a.rms
        assert off < AUTO.limit + 3 * np.hypot(a.floor, b.floor)


def test_facts_render_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(planner, "look")
    convex = scene(geometry=CATALOGUE.geometries["sphere"], view=ABOVE, light=CATALOGUE.lights["studio"])
    made = planned(convex, EffectSettings(), REFERENCE)
    assert made.effects == {Effect.LIGHT_DETAIL}
    assert {d.basis for d in made.decisions} == {Basis.FACT}
    assert planned(scene(), EffectSettings(plan=Plan.FACTS), REFERENCE).effects == {S, B}


def test_all_heeds_no_facts_about_the_shape() -> None:
    made = planned(scene(height=0.0), EffectSettings(plan=Plan.ALL), REFERENCE)
    assert (made.heeded, made.bounces) == (False, REFERENCE.bounces)
    assert made.effects >= {S, B}
    assert not made.geometry.convex
    assert by_effect(made)[S].basis is Basis.USER


def test_a_pose_that_folds_calls_for_deformation(mi: ModuleType) -> None:
    bend = {"kind": "bend", "degrees": 150.0, "axis": "x", "towards": "z"}
    view = {"kind": "image", "size": 32, "direction": [1.0, -0.2, 1.0]}
    made = planned(scene(0.01, 0.0, bend, view=view), AUTO, REFERENCE)
    assert made.effects == {S, D}
    still = planned(scene(0.01, 0.2, bend | {"degrees": 0.01}), AUTO, REFERENCE)
    assert still.effects == {S}


def test_what_is_undecided_is_simulated(mi: ModuleType) -> None:
    """Two looks cannot tell a contribution from a tolerance that equals it."""
    close = by_effect(planned(scene(), AUTO, REFERENCE))[S].contribution
    made = planned(scene(), EffectSettings(tolerance=close, budget=1e-6), REFERENCE)
    found = by_effect(made)[S]
    assert found.simulated
    assert "undecided within its budget of 1e-06 s" in found.reason


def test_small_effects_that_add_up_are_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """The largest first, a bounce at a time, until what is left out together is small."""
    shape = scene(0.5, 0.2, {"kind": "wave", "amplitude": 0.02})
    asked = planner._Planner(shape, AUTO, REFERENCE, facts(shape))
    small, smaller = Bound(0.008, 0.007, 0.009), Bound(0.001, 0.0009, 0.002)
    asked.bounds = {S: [Bound(0.5, 0.4, 0.6)], B: [small, smaller], D: [Bound(0.006, 0.005, 0.007)]}
    rendered: list[Variant] = []

    def bound(full: Variant, without: Variant) -> Bound:
        rendered.append(without)
        return Bound(0, 0, 0.009) if without.bounces or D in without.effects else Bound(0, 0, 0.012)

    asked.looks = [SimpleNamespace(whole=True, bound=bound)]  # pyright: ignore[reportAttributeAccessIssue]
    monkeypatch.setattr(Variants, "rendered", lambda self, looks, variant: variant)
    kept, reasons = asked._kept([S, B, D])
    assert kept == {S: 1, B: 0, D: 0}
    asked._together(kept, reasons)
    assert kept == {S: 1, B: 1, D: 0}
    assert reasons[B] == "below the tolerance by itself, not together with others"
    assert [(D in v.effects, v.bounces) for v in rendered] == [(False, 0), (False, 1)]


def test_a_list_is_taken_and_what_it_leaves_out_is_measured(mi: ModuleType) -> None:
    made = planned(scene(), EffectSettings(plan=("self-shadowing",)), REFERENCE)
    assert made.effects == {S}
    told = by_effect(made)
    assert (told[S].basis, told[B].basis) == (Basis.USER, Basis.USER)
    assert told[B].low > 0.005
    (line,) = warnings(made.decisions, 0.005)
    assert line.startswith("interreflection is left out as asked, but matters: it contributes ")
    assert not warnings(made.decisions, 10.0)


def test_a_scalar_variant_is_not_probed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(planner, "look")
    made = planned(scene(), AUTO, replace(REFERENCE, variant="scalar_rgb"))
    assert made.effects == {S, B}
    assert "too slow" in by_effect(made)[S].reason


def test_decisions_are_kept(mi: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = decided(scene(), AUTO, REFERENCE, tmp_path)
    with monkeypatch.context() as patch:
        patch.delattr(planner, "look")
        again = decided(scene(), AUTO, REFERENCE, tmp_path)
    assert again.decisions == first.decisions or str(again.decisions) == str(first.decisions)  # NaN is not itself
    assert (again.effects, again.bounces) == (first.effects, first.bounces)
    (file,) = tmp_path.iterdir()
    file.write_text("[{")
    assert decided(scene(), AUTO, REFERENCE, tmp_path).effects == first.effects
    assert decided(scene(), replace(AUTO, tolerance=5.0), REFERENCE, tmp_path).effects == frozenset()


def test_a_strip_shows_each_contribution(mi: ModuleType) -> None:
    made, picture = CATALOGUE.contributions(scene(), EffectSettings(), REFERENCE)
    assert made.effects == {S, B}
    assert picture is not None
    width, _ = Image.open(io.BytesIO(picture)).size
    assert width > 3 * 32 * 6
    points = CATALOGUE.contributions(scene(view={"kind": "vertices", "count": 50}), EffectSettings(), REFERENCE)
    assert points[1] is None


def test_contributions_are_those_of_all_effects_at_all_points(mi: ModuleType) -> None:
    found = contributions(scene(), EffectSettings(), REFERENCE)
    assert set(found.differences) == {S, B}
    n = len(found.scene.points)
    assert found.radiance.shape == found.differences[S].shape == (n, 3)
    assert found.differences[S].mean() < 0 < found.differences[B].mean()
    power = np.sqrt((found.radiance**2).mean())
    told = by_effect(found.scene)
    assert np.sqrt((found.differences[B] ** 2).mean()) / power == pytest.approx(told[B].contribution, rel=0.3)


def test_light_that_scatters_inside_is_held_against_an_opaque_surface(mi: ModuleType) -> None:
    wax = {"kind": "translucent", "reflectance": [0.8] * 3, "mean_free_path": 0.05, "albedo": 1.0}
    lit = CATALOGUE.scene(
        name="wax",
        light={"kind": "projected", "of": "studio", "order": 6},
        material=wax,
        geometry=CATALOGUE.geometries["slab-waffle"],
        view={"kind": "image", "size": 32, "direction": [0.2, -0.5, 1.0]},
    )
    for plan in (Plan.AUTO, Plan.ALL):
        made = planned(lit, EffectSettings(plan=plan), ReferenceSettings())
        assert made.effects == {Effect.SUBSURFACE}
    probed = by_effect(planned(lit, EffectSettings(), ReferenceSettings()))[Effect.SUBSURFACE]
    assert probed.basis is Basis.PROBE
    assert probed.low > 0.1
