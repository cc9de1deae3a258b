"""Every method keeps the laws of `envbench.method` on random scenes; a method that breaks one is found out."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, reject, settings
from hypothesis import strategies as st

from data_gen import measured
from data_gen.materials import LOBES, MATERIALS, build
from envbench import laws
from envbench.errors import NeedsData
from envbench.furnace import lobe_integrals
from envbench.geometry import Geometry, Points, Viewer
from envbench.material import Material
from envbench.method import Method, Tolerance
from methods import METHODS

RANDOM = settings(
    derandomize=True, database=None, deadline=None, phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow],
)  # fmt: skip
"""The same examples in every run; a failing one is shown as it was drawn, since to shrink it takes minutes."""
SCENES = int(os.environ.get("ENVBENCH_SCENES", "6"))
"""Random scenes for each method; ``ENVBENCH_SCENES=20`` before a release."""
SHARPEST = 0.15
"""Of the random lobes, radians: what the cheapest settings of a sweep can be held to; `hard-cases` goes further."""

# what is drawn of each kind of lobe; a kind that is not here takes its defaults
PARAMETERS: dict[str, dict[str, st.SearchStrategy[Any]]] = {
    "phong": {"exponent": st.floats(1, 2 / SHARPEST**2), "clipped": st.booleans()},
    "microfacet": {"sigma": st.floats(SHARPEST, 0.6), "clipped": st.booleans()},
    "ggx": {"roughness": st.floats(SHARPEST**0.5, 1), "clipped": st.booleans()},
    "cook-torrance": {"roughness": st.floats(SHARPEST, 0.6), "clipped": st.booleans()},
    "lafortune": {"diffuse": st.tuples(*[st.floats(0.05, 0.9)] * 3).map(list)},
    "kajiya-kay": {"exponent": st.floats(1, 2 / SHARPEST**2)},
}
REFLECTANCE = st.tuples(*[st.floats(0.05, 1)] * 3).map(list)


@st.composite
def tables(draw: st.DrawFn) -> dict[str, Any]:
    kind = draw(st.sampled_from(sorted(LOBES)))
    drawn = {name: draw(values) for name, values in PARAMETERS.get(kind, {}).items()}
    return {"kind": kind, "reflectance": draw(REFLECTANCE), **drawn}


@st.composite
def materials(draw: st.DrawFn) -> Material:
    """Draw one or two lobes with parameters of their own, or a preset: an analytic one, or a measured one."""
    kind = draw(st.sampled_from(["lobes", "lobes", "analytic", "measured"]))
    if kind == "lobes":
        return build({"lobes": draw(st.lists(tables(), min_size=1, max_size=2))}, "drawn")
    name = draw(
        st.sampled_from(sorted(MATERIALS.keys() - measured.PRESETS.keys() if kind == "analytic" else measured.PRESETS))
    )
    try:
        return build(MATERIALS[name], name)
    except NeedsData:
        reject()


def broken_laws(kind: type[Method], material: Material, seed: int) -> list[str]:
    """Check the cheapest settings of the method's own sweep that hold it to something on this material."""
    found: list[str] = []
    for method in kind.sweep():
        found = laws.check(method, material, seed)
        if not any("holds it to nothing" in line for line in found):
            break
    return found


@pytest.mark.parametrize("name", METHODS)
def test_a_method_keeps_the_laws(name: str, mi: object) -> None:
    @settings(RANDOM, max_examples=SCENES)
    @given(materials(), st.integers(0, 10**6))
    def on_random_scenes(material: Material, seed: int) -> None:
        assert broken_laws(METHODS[name], material, seed) == []

    on_random_scenes()


@pytest.mark.parametrize("material", ["lambertian", "phong-whole"])
@pytest.mark.parametrize("name", METHODS)
def test_white_furnace(name: str, material: str, mi: object) -> None:
    """An albedo-1 material under constant light of 1 returns 1, to what the method states."""
    white = build(MATERIALS[material], material)
    _, points = laws.queries(np.random.default_rng(0), 16)[1]
    assert np.allclose(lobe_integrals(white, points), 1, rtol=0, atol=1e-6)
    method = METHODS[name].sweep()[-1]
    found = laws.furnace(method, white)
    if found is not None:
        assert abs(found.mean) <= method.tolerance(method.prepare(white, Geometry("sphere"))).constant_light


@dataclass(frozen=True)
class Mean(Method):
    """Mean radiance times the lobes' integrals: keeps every law but one, which `fault` names."""

    fault: str = ""
    name = "mean"
    summary = source = "a test"

    def declines(self, scene: Any) -> str | None:
        if self.fault == "declines all" or (self.fault == "needs a viewer" and scene.viewer is None):
            return self.fault
        return None

    def prepare(self, material: Any, geometry: Any) -> Any:
        return {"material": material, "calls": [0]}

    def relight(self, prepared: Any, environment: Any) -> Any:
        if self.fault == "changes an earlier state":
            prepared["calls"][0] += 1
        radiance = environment.radiance
        if self.fault == "sum of lights":  # fireflies are cut off
            radiance = np.minimum(radiance, 20 * radiance.mean())
        solid_angle = np.sin(np.pi * (np.arange(len(radiance)) + 0.5) / len(radiance))
        mean = np.average(radiance.astype(float).mean(1), axis=0, weights=solid_angle)
        mean = mean + (1e-3 if self.fault == "zero light" else 0)
        state = {**prepared, "mean": mean, "first": radiance[0, 0], "viewer": None}
        return {**state, "hook": lambda: 0} if self.fault == "cannot be pickled" else state

    def frame(self, relit: Any, viewer: Viewer | None) -> Any:
        return {**relit, "viewer": viewer}

    def shade(self, framed: Any, points: Points) -> Any:
        out = framed["mean"] * lobe_integrals(framed["material"], points)
        match self.fault:
            case "different bits":
                out = out * (1 + 1e-12 * np.random.default_rng().random())
            case "scaled light":
                out = out**1.01
            case "constant light":
                out = 1.1 * out
            case "turned light":
                out = out + framed["first"] - framed["mean"]
            case "turned light, points and view":  # wrong where each point has a view of its own
                out = out * (1 if framed["viewer"] else points.view[:, :1] ** 2)
        return out

    def tolerance(self, prepared: Any) -> Tolerance:
        return Tolerance(rotation=2.0) if self.fault == "rotation = 2 holds it to nothing" else Tolerance()


LAMBERTIAN = build(MATERIALS["lambertian"], "lambertian")


@pytest.mark.parametrize(
    "fault",
    ["different bits", "scaled light", "sum of lights", "zero light", "constant light", "turned light",
     "turned light, points and view", "cannot be pickled", "changes an earlier state",
     "rotation = 2 holds it to nothing"],
)  # fmt: skip
def test_a_broken_law_is_named(fault: str) -> None:
    assert any(fault in line for line in laws.check(Mean(fault), LAMBERTIAN, count=8))


@pytest.mark.parametrize("fault", ["", "needs a viewer", "declines all"])
def test_a_method_without_fault_keeps_all(fault: str) -> None:
    assert laws.check(Mean(fault), LAMBERTIAN, count=8) == []


def test_furnace_tells_what_is_gained() -> None:
    assert laws.furnace(Mean("declines all"), LAMBERTIAN) is None
    for fault, gain in (("", 0), ("constant light", 0.1)):
        found = laws.furnace(Mean(fault), LAMBERTIAN, count=8)
        assert found is not None
        assert found.mean == pytest.approx(gain, abs=1e-6)
        assert found.worst == pytest.approx(gain, abs=1e-6)
