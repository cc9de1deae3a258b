"""The methods of precomputed transfer as methods: laws on a mesh, poses, points between vertices, what they decline."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from data_gen import geometry as shapes
from data_gen import views
from data_gen.materials import build
from envbench import latlong
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.method import Method
from envbench.scene import Effect, Scene
from methods.ldprt import LDPRT, BentNormal, GlossyLDPRT, LinearLobe, SHRotation, StaticPRT, ZonalLight

WHITE = build({"kind": "lambertian", "reflectance": [0.5, 0.7, 0.9]}, "white")
GLOSSY = build({"kind": "cook-torrance", "roughness": 0.4}, "glossy")
SMALL = {"rays": 200}
DIFFUSE: list[Method] = [
    LDPRT(**SMALL), LDPRT(lobes=1, **SMALL), LDPRT(table=True, **SMALL), LinearLobe(**SMALL), BentNormal(**SMALL),
    SHRotation(**SMALL), SHRotation(turning="light", **SMALL), StaticPRT(**SMALL), ZonalLight(**SMALL),
]  # fmt: skip
ALL = [*DIFFUSE, GlossyLDPRT(rays=256)]
TURNING = [m for m in ALL if not isinstance(m, StaticPRT)]


@pytest.fixture(scope="module")
def bumps() -> Geometry:
    table = {"kind": "patch", "texture": "bumps", "tiles": 2, "size": 1.0, "resolution": 17, "height": 0.1}
    return shapes.build({**table, "pose": {"kind": "wave", "amplitude": 0.1}}, "bumps")


def light(seed: int = 0) -> Environment:
    smooth = np.random.default_rng(seed).uniform(0.2, 1.0, (4, 8, 3))
    return Environment("l", latlong.interpolate(smooth, latlong.grid(16, 32)).astype(np.float32))


def material(method: Method) -> Any:
    return GLOSSY if isinstance(method, GlossyLDPRT) else WHITE


def at_vertices(shape: Geometry) -> Points:
    return views.build({"kind": "vertices", "direction": [0.1, -0.3, 0.9]}, shape)[0]


def shaded(method: Method, shape: Geometry, environment: Environment, points: Points) -> np.ndarray:
    prepared = method.prepare(material(method), shape.rest)
    return np.asarray(method.shade(method.frame(method.relight(prepared, environment), None), points), float)


def nrmse(found: np.ndarray, exact: np.ndarray) -> float:
    return float(np.sqrt(np.mean((found - exact) ** 2) / np.mean(exact**2)))


@pytest.mark.parametrize("method", ALL, ids=repr)
def test_laws(method: Method, bumps: Geometry) -> None:
    """Deterministic, linear, zero for zero, picklable; to single precision, 36 terms of which sum."""
    points = at_vertices(bumps)
    prepared = method.prepare(material(method), bumps.rest)
    before = pickle.dumps(prepared)

    def render(environment: Environment) -> np.ndarray:
        relit = method.relight(prepared, environment)
        copied = pickle.loads(pickle.dumps(relit))
        return np.asarray(method.shade(method.frame(copied, None), points), float)

    a, b = light(0), light(1)
    found = render(a)
    assert np.array_equal(found, render(a))
    assert not np.any(render(replace(a, radiance=0 * a.radiance)))
    both = render(Environment("sum", a.radiance + 3 * b.radiance))
    if not isinstance(method, ZonalLight):  # a fit is not linear
        np.testing.assert_allclose(both, found + 3 * render(b), atol=3e-5 * np.abs(both).max())
    assert pickle.dumps(prepared) == before


@pytest.mark.parametrize("method", TURNING, ids=repr)
def test_turning_light_points_and_view_changes_nothing(method: Method, bumps: Geometry) -> None:
    """The table is not isotropic: it errs by what it states, some 1e-2; the light's own samples are worth 1e-3."""
    R = Rotation.from_rotvec([0.4, -0.8, 0.3]).as_matrix()
    points = at_vertices(bumps)
    assert points.rotation is not None
    moved = replace(
        points, **{k: getattr(points, k) @ R.T for k in ("position", "normal", "geometric_normal", "tangent", "view")},
        rotation=R @ points.rotation,
    )  # fmt: skip
    lamp, wide = light(), 64
    grid = latlong.grid(wide, 2 * wide)
    here, there = (Environment("l", lamp(grid @ turn).astype(np.float32)) for turn in (np.eye(3), R))
    a, b = shaded(method, bumps, here, points), shaded(method, bumps, there, moved)
    assert nrmse(b, a) < (2e-2 if getattr(method, "table", False) else 5e-3)


def test_lobes_approach_the_full_rotation(bumps: Geometry) -> None:
    points, environment = at_vertices(bumps), light()
    exact = shaded(SHRotation(**SMALL), bumps, environment, points)
    errors = [nrmse(shaded(LDPRT(lobes=n, **SMALL), bumps, environment, points), exact) for n in (1, 2, 4, 6)]
    assert errors == sorted(errors, reverse=True)
    assert errors[2] < 0.02
    assert nrmse(shaded(StaticPRT(**SMALL), bumps, environment, points), exact) > 3 * errors[2]


def test_constant_light_gives_reflectance_times_openness(bumps: Geometry) -> None:
    """Without shadows constant light returns the reflectance; with them, less; at rest and posed alike."""
    ones, points = Environment("ones", np.ones((16, 32, 3), np.float32)), at_vertices(bumps)
    open_, dark = (shaded(LDPRT(transfer=t, **SMALL), bumps, ones, points) for t in ("unshadowed", "shadowed"))
    np.testing.assert_allclose(open_, np.tile([0.5, 0.7, 0.9], (len(points), 1)), rtol=2e-3)
    assert 0.3 < dark.mean() / open_.mean() < 0.99


def test_points_between_vertices_are_blends(bumps: Geometry) -> None:
    """An image's points see three corners each; on a flat unshadowed patch all that is one colour."""
    points = views.build({"kind": "image", "size": 16, "direction": [0.0, 0.0, 1.0]}, bumps)[0]
    ones = Environment("ones", np.ones((16, 32, 3), np.float32))
    found = shaded(LDPRT(transfer="unshadowed", **SMALL), bumps, ones, points)
    np.testing.assert_allclose(found, np.tile([0.5, 0.7, 0.9], (len(points), 1)), rtol=2e-3)


def test_what_is_declined_and_lacking(bumps: Geometry) -> None:
    points = at_vertices(bumps)
    effects = frozenset({Effect.SELF_SHADOWING, Effect.DEFORMATION, Effect.INTERREFLECTION})
    scene = Scene("s", light(), WHITE, bumps, points, None, effects)
    assert LDPRT(transfer="shadowed").lacks(scene) == {Effect.DEFORMATION, Effect.INTERREFLECTION}
    assert LDPRT().lacks(scene) == {Effect.DEFORMATION}
    assert LDPRT(transfer="unshadowed").lacks(scene) == effects
    assert LDPRT(transfer="interreflected").lacks(scene) == {Effect.DEFORMATION}
    assert "needs a mesh" in str(LDPRT().declines(replace(scene, geometry=Geometry("sphere"))))
    assert "diffuse lobes only" in str(LDPRT().declines(replace(scene, material=GLOSSY)))
    thin = replace(scene, material=build({"kind": "membrane"}, "thin"))
    assert "closed form" in str(LDPRT(transfer="shadowed").declines(thin))
    for closed in (LDPRT(transfer="unshadowed", lobes=1), LDPRT(lobes=1)):
        assert closed.declines(thin) is None
        assert closed.lacks(thin) == effects
    assert "tangent" in str(GlossyLDPRT().declines(replace(scene, material=build({"kind": "kajiya-kay"}, "hair"))))
    method = LDPRT(**SMALL)
    state = method.relight(method.prepare(WHITE, bumps.rest), light())
    with pytest.raises(BadInput, match="on a mesh"):
        method.shade(state, replace(points, triangle=None))


SHADOWS, BOUNCES, DEFORMS, VIEWED = (
    Effect.SELF_SHADOWING, Effect.INTERREFLECTION, Effect.DEFORMATION, Effect.VIEW_DEPENDENCE,
)  # fmt: skip


@pytest.mark.parametrize("method", DIFFUSE, ids=repr)
@pytest.mark.parametrize(
    ("effects", "bounces", "expected", "lacking"),
    [
        ({DEFORMS}, None, ("unshadowed", 1), {DEFORMS}),
        ({SHADOWS}, None, ("shadowed", 1), set[Effect]()),
        ({SHADOWS, DEFORMS}, 5, ("shadowed", 1), {DEFORMS}),
        ({SHADOWS, BOUNCES}, None, ("interreflected", 1), set[Effect]()),
        ({SHADOWS, BOUNCES}, 3, ("interreflected", 3), set[Effect]()),
        ({SHADOWS, BOUNCES}, 40, ("interreflected", 16), set[Effect]()),
    ],
)
def test_auto_is_the_transfer_that_the_scene_calls_for(
    method: Any, bumps: Geometry, effects: set[Effect], bounces: int | None, expected: Any, lacking: set[Effect]
) -> None:
    scene = Scene("s", light(), WHITE, bumps, at_vertices(bumps), None, frozenset(effects), bounces)
    made = method.called_for(scene)
    assert (made.transfer, made.bounces) == expected
    assert made == replace(method, transfer=expected[0], bounces=expected[1])  # all else as it was
    assert made.called_for(scene) is made
    assert method.lacks(scene) == made.lacks(scene) == lacking
    given = replace(method, transfer="shadowed")
    assert given.called_for(scene) is given


def test_glossy_auto(bumps: Geometry) -> None:
    scene = Scene("s", light(), GLOSSY, bumps, at_vertices(bumps), None, frozenset({VIEWED, SHADOWS, DEFORMS}))
    bare = replace(scene, effects=frozenset({VIEWED}))
    found = [GlossyLDPRT().called_for(one).transfer for one in (scene, bare)]
    assert found == ["shadowed", "unshadowed"]
    assert GlossyLDPRT().lacks(scene) == {DEFORMS}
    assert not GlossyLDPRT().lacks(bare)


def test_what_was_simulated_is_told(bumps: Geometry) -> None:
    def told(method: Method) -> dict[str, Any]:
        return method.describe(method.prepare(material(method), bumps.rest))

    assert told(LDPRT(**SMALL))["transfer"] == "shadowed"  # no scene was asked
    assert told(GlossyLDPRT(rays=64, transfer="unshadowed"))["transfer"] == "unshadowed"
    lit = told(LDPRT(transfer="interreflected", bounces=2, **SMALL))
    assert (lit["transfer"], lit["bounces"]) == ("interreflected", 2)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: LDPRT(lobes=0), r"lobes must lie in \[1, 11\]"),
        (lambda: LDPRT(lobes=12), "as many as the highest band"),
        (lambda: LDPRT(order=2, lobes=3), "need order > 2"),
        (lambda: LDPRT(order=40), "order must lie in"),
        (lambda: LDPRT(rays=0), "rays must lie in"),
        (lambda: LDPRT(transfer="path"), "'auto', 'unshadowed', 'shadowed', 'interreflected'"),
        (lambda: GlossyLDPRT(transfer="path"), "'auto', 'unshadowed' or 'shadowed'"),
        (lambda: SHRotation(turning="both"), "'transfer', 'light'"),
        (lambda: GlossyLDPRT(rows=17), r"rows must lie in \[1, 16\]"),
        (lambda: ZonalLight(lobes=0), "lobes must lie in"),
    ],
)
def test_settings_are_refused_in_one_line(make: Any, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        make()


def test_subsurface_transfer_needs_a_medium_and_a_scene_that_has_it() -> None:
    method = LDPRT(transfer="subsurface", rays=200)
    slab = shapes.build({**shapes.GEOMETRIES["slab-waffle"], "resolution": 9, "tiles": 1}, "slab")
    wax = build({"kind": "translucent", "mean_free_path": 0.2}, "wax")
    made = Scene("s", light(), wax, slab, at_vertices(slab), effects=frozenset({Effect.SUBSURFACE}))
    assert method.refusal(made) is None
    assert method.lacks(made) == set()
    assert LDPRT(transfer="shadowed").lacks(made) == {Effect.SUBSURFACE}
    assert "medium" in str(method.refusal(replace(made, material=WHITE)))
    assert "leaves out" in str(method.refusal(replace(made, effects=frozenset({Effect.SELF_SHADOWING}))))
    prepared = method.prepare(wax, slab)
    assert method.describe(prepared)["walks a vertex"] == 200
    with pytest.raises(BadInput, match="medium"):
        method.prepare(WHITE, slab)
    open_sheet = shapes.build({"kind": "patch", "texture": "bumps", "resolution": 9}, "sheet")
    with pytest.raises(BadInput, match="closed"):
        method.prepare(wax, open_sheet)
    constant = Environment("constant", np.ones((16, 32, 3), np.float32))
    exact = SHRotation(transfer="subsurface", rays=200)
    found = exact.shade(exact.relight(exact.prepare(wax, slab), constant), at_vertices(slab))
    assert found == pytest.approx(1, abs=1e-4)  # a white medium returns all
