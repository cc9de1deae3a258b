"""The effects that a scene's facts call for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import benchmarks.catalogue
from benchmarks.catalogue import CATALOGUE
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, Pose, TriangleMesh
from envbench.scene import Effect, Scene

MESH = TriangleMesh(np.eye(3), np.array([[0, 1, 2]], np.int32), np.eye(3))
POSE = Pose("bent", np.eye(3), np.eye(3), np.tile(np.eye(3), (3, 1, 1)))
LEAF = Geometry("leaf", MESH, convex=False)
SHADOWS, DEFORMS, VIEWED = Effect.SELF_SHADOWING, Effect.DEFORMATION, Effect.VIEW_DEPENDENCE
BOUNCES = Effect.INTERREFLECTION


TETRAHEDRON = TriangleMesh(
    np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]], np.int32),
    np.tile([0.0, 0, 1], (4, 1)),
)  # fmt: skip
SOLID = Geometry("solid", TETRAHEDRON)
INSIDE = Effect.SUBSURFACE
WAX = {"kind": "translucent", "mean_free_path": 0.1}


def built(
    monkeypatch: pytest.MonkeyPatch, shape: Geometry, kind: str | dict[str, Any], effects: tuple[Effect, ...] | None
) -> Scene:
    one = np.array([[0.0, 0, 1]])

    def queries(names: tuple[str, str], spec: str) -> tuple[Geometry, Points, None]:
        assert names == ("leaf", "front")
        return shape, Points(one, one, one, one[:, [2, 0, 1]], one, np.ones(1)), None

    monkeypatch.setattr(benchmarks.catalogue, "_queries", queries)
    name = "constant/test/leaf/front" + ("" if effects is None else f" [{', '.join(sorted(effects)) or 'no effects'}]")
    parts: dict[str, Any] = {"light": {"kind": "constant"}, "geometry": {}, "view": {}}
    material = {"kind": kind} if isinstance(kind, str) else kind
    return CATALOGUE.scene(name=name, effects=effects, material=material, **parts)


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
        (SOLID, WAX, None, {INSIDE}),
        (SOLID, WAX, (INSIDE,), {INSIDE}),
        (SOLID, WAX, (SHADOWS,), set[Effect]()),
        (replace(SOLID, convex=False), WAX, (SHADOWS,), {SHADOWS}),
        (replace(SOLID, convex=False), WAX, None, {INSIDE}),
        (replace(SOLID, convex=False), WAX, (INSIDE, SHADOWS), {INSIDE}),
        (LEAF, WAX, (SHADOWS,), {SHADOWS}),
    ],
)
def test_follow_from_facts_or_are_chosen(
    monkeypatch: pytest.MonkeyPatch,
    shape: Geometry,
    kind: str | dict[str, Any],
    effects: tuple[Effect, ...] | None,
    expected: set[Effect],
) -> None:
    assert built(monkeypatch, shape, kind, effects).effects == expected


@pytest.mark.parametrize(
    ("shape", "kind", "effects", "words"),
    [
        (LEAF, WAX, None, "'leaf' is none"),
        (LEAF, WAX, (INSIDE,), "closed mesh"),
        (Geometry("ball"), WAX, None, "closed mesh"),
        (SOLID, "lambertian", (INSIDE,), "no medium"),
        (LEAF, {"kind": "membrane", "transparency": {"kind": "gradient"}}, (), "no uv"),
    ],
)
def test_what_makes_no_sense_is_said(
    monkeypatch: pytest.MonkeyPatch,
    shape: Geometry,
    kind: str | dict[str, Any],
    effects: tuple[Effect, ...] | None,
    words: str,
) -> None:
    with pytest.raises(BadInput, match=words):
        built(monkeypatch, shape, kind, effects)
