"""The effects that a scene's facts call for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import benchmarks.catalogue
from benchmarks.catalogue import CATALOGUE
from envbench.geometry import Geometry, Points, Pose, TriangleMesh
from envbench.scene import Effect, Scene

MESH = TriangleMesh(np.eye(3), np.array([[0, 1, 2]], np.int32), np.eye(3))
POSE = Pose("bent", np.eye(3), np.eye(3), np.tile(np.eye(3), (3, 1, 1)))
LEAF = Geometry("leaf", MESH, convex=False)
SHADOWS, DEFORMS, VIEWED = Effect.SELF_SHADOWING, Effect.DEFORMATION, Effect.VIEW_DEPENDENCE
BOUNCES = Effect.INTERREFLECTION


def built(monkeypatch: pytest.MonkeyPatch, shape: Geometry, kind: str, effects: tuple[Effect, ...] | None) -> Scene:
    one = np.array([[0.0, 0, 1]])

    def queries(names: tuple[str, str], spec: str) -> tuple[Geometry, Points, None]:
        assert names == ("leaf", "front")
        return shape, Points(one, one, one, one[:, [2, 0, 1]], one, np.ones(1)), None

    monkeypatch.setattr(benchmarks.catalogue, "_queries", queries)
    name = "constant/test/leaf/front" + ("" if effects is None else f" [{', '.join(sorted(effects)) or 'no effects'}]")
    parts: dict[str, Any] = {"light": {"kind": "constant"}, "material": {"kind": kind}, "geometry": {}, "view": {}}
    return CATALOGUE.scene(name=name, effects=effects, **parts)


@pytest.mark.parametrize(
    ("shape", "kind", "effects", "expected"),
    [
        (replace(LEAF, convex=True), "lambertian", None, set[Effect]()),
        (LEAF, "lambertian", None, {SHADOWS, BOUNCES}),
        (LEAF, "phong", None, {SHADOWS, BOUNCES, VIEWED}),
        (replace(LEAF, pose=POSE), "lambertian", None, {SHADOWS, BOUNCES, DEFORMS}),
        (replace(LEAF, convex=True, pose=POSE), "lambertian", None, {SHADOWS, BOUNCES, DEFORMS}),
        (replace(LEAF, convex=True, pose=replace(POSE, convex=True)), "lambertian", None, set[Effect]()),
        (replace(LEAF, pose=POSE), "lambertian", (SHADOWS,), {SHADOWS}),
        (replace(LEAF, pose=POSE), "phong", (), set[Effect]()),
        (LEAF, "lambertian", (SHADOWS, Effect.INTERREFLECTION), {SHADOWS, Effect.INTERREFLECTION}),
    ],
)
def test_follow_from_facts_or_are_chosen(
    monkeypatch: pytest.MonkeyPatch,
    shape: Geometry,
    kind: str,
    effects: tuple[Effect, ...] | None,
    expected: set[Effect],
) -> None:
    assert built(monkeypatch, shape, kind, effects).effects == expected
