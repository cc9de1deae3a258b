"""Every method keeps the laws of `envbench.method`; a method that breaks one is found out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from data_gen.materials import MATERIALS, build
from envbench import laws
from envbench.furnace import lobe_integrals
from envbench.geometry import Points
from envbench.method import Method
from methods import METHODS


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("name", METHODS)
def test_a_method_keeps_the_laws(name: str, material: str, mi: object) -> None:
    assert laws.check(METHODS[name].sweep()[0], build(MATERIALS[material], material)) == []


@dataclass(frozen=True)
class Mean(Method):
    """Mean radiance times the lobes' integrals: keeps every law but one, which `fault` names."""

    fault: str = ""
    name = "mean"
    summary = source = "a test"

    def prepare(self, material: Any, geometry: Any) -> Any:
        return {"material": material, "calls": [0]}

    def relight(self, prepared: Any, environment: Any) -> Any:
        if self.fault == "changes an earlier state":
            prepared["calls"][0] += 1
        mean = environment.mean + (1e-3 if self.fault == "zero light" else 0)
        state = {**prepared, "mean": mean, "first": environment.radiance[0, 0]}
        return {**state, "hook": lambda: 0} if self.fault == "cannot be pickled" else state

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
        return out


@pytest.mark.parametrize(
    "fault",
    ["", "different bits", "scaled light", "zero light", "constant light", "turned light", "cannot be pickled",
     "changes an earlier state"],
)  # fmt: skip
def test_a_broken_law_is_named(fault: str) -> None:
    broken = laws.check(Mean(fault), build(MATERIALS["lambertian"], "lambertian"), count=16)
    assert (broken == []) if not fault else any(fault in line for line in broken)
