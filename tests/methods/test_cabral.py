"""Cabral's sphere maps: warps and weights against their printed formulae, the whole against direct integration."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

from data_gen import views
from data_gen.lobes import KajiyaKay, Lambertian, Microfacet, Phong
from envbench import latlong, laws
from envbench.directions import Array, normalised, perpendicular, uniform
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, Viewer
from envbench.material import Lobe, Material
from envbench.scene import Scene
from methods.angular.prefilter import prefilter_at
from methods.cabral import Cabral, icosahedron, spheremap
from methods.cabral.mesh import disk_mesh

SPHERE = Geometry("sphere")


def light(height: int = 48) -> Environment:
    """Light that varies over about a radian."""
    x, y, z = np.moveaxis(latlong.grid(height, 2 * height), -1, 0)
    return Environment("smooth", np.stack([1 + x, 1 + y * z, 1 + np.sin(2 * x + z)], -1).astype(np.float32))


def constant() -> Environment:
    return Environment("constant", np.ones((48, 96, 3), np.float32))


def seen_from(view: Array, count: int = 400, seed: int = 0) -> tuple[Viewer, Points]:
    """Return queries of one distant viewer whose mirror directions are uniform."""
    normal = normalised(uniform(count, np.random.default_rng(seed)) + view)
    x, y, z = map(float, view)
    points = Points(normal, normal, normal, perpendicular(normal), np.tile(view, (count, 1)), np.full(count, 1 / count))
    return Viewer(direction=(x, y, z)), points


def rendered(method: Cabral, environment: Environment, viewer: Viewer, points: Points, *lobes: Lobe) -> Any:
    relit = method.relight(method.prepare(Material("m", lobes), SPHERE), environment)
    return method.shade(method.frame(relit, viewer), points)


def integrated(environment: Environment, points: Points, *lobes: Lobe) -> Array:
    return sum(
        prefilter_at(environment.radiance, lobe, points.central(lobe.centre), points.view, points.normal, 1e-4)
        for lobe in lobes
    )


def nrmse(result: Any, truth: Any) -> float:
    return float(np.sqrt(np.mean((result - truth) ** 2) / np.mean(truth**2)))


def fast(**settings: Any) -> Cabral:
    return Cabral(**{"prefilter": "angular", "eps": 1e-3, "light_rows": 0, "size": 48, **settings})


# --- weights --------------------------------------------------------------------------------------------------------


def printed_area(a: Array, b: Array, c: Array) -> float:
    """Sec. 3.4 as printed: the sum of the dihedral angles, from normalised cross products, less pi."""

    def angle(at: Array, p: Array, q: Array) -> float:
        return np.arccos(normalised(np.cross(at, p)) @ normalised(np.cross(at, q)))

    return angle(a, b, c) + angle(b, c, a) + angle(c, a, b) - np.pi


@pytest.mark.parametrize("count", [12, 42, 162])
def test_weights_are_the_printed_spherical_excesses(count: int) -> None:
    vertices, faces = icosahedron.sphere(count)
    assert len(vertices) == count
    assert len(faces) == 2 * count - 4
    for direction in uniform(50, np.random.default_rng(0)):
        face, weights = icosahedron.subtended(count, direction)
        a, b, c = vertices[face]
        whole = printed_area(a, b, c)
        expected = [printed_area(b, c, direction), printed_area(c, a, direction), printed_area(a, b, direction)]
        # angles by arccos lose half the digits where it is flat
        np.testing.assert_allclose(weights, np.array(expected) / whole, atol=1e-6 / whole)
        assert weights.sum() == pytest.approx(1, abs=1e-12)
        assert np.linalg.solve(vertices[face].T, direction).min() > -1e-12  # it does lie in that face


@pytest.mark.parametrize("count", [12, 42, 162])
def test_weights_at_vertices_and_across_edges(count: int) -> None:
    vertices, faces = icosahedron.sphere(count)
    for number, vertex in enumerate(vertices):
        face, weights = icosahedron.subtended(count, vertex)
        np.testing.assert_allclose(weights, face == number, atol=1e-7)

    def spread(direction: Array) -> Array:
        out = np.zeros(count)
        face, weights = icosahedron.subtended(count, direction)
        out[face] = weights
        return out

    jumps = []
    for a, b, c in vertices[faces[:20]]:
        for t in (0.1, 0.5, 0.8):
            edge = normalised((1 - t) * a + t * b)
            assert np.isfinite(spread(edge)).all()
            off = 1e-7 * normalised(c - edge)
            jumps.append(np.abs(spread(normalised(edge + off)) - spread(normalised(edge - off))).max())
    # faces of the icosahedron are mirror images of each other; those of its subdivisions are so only nearly
    assert max(jumps) < (1e-5 if count == 12 else 0.05)


# --- warps ----------------------------------------------------------------------------------------------------------


def test_the_warps_are_those_printed() -> None:
    p = uniform(200, np.random.default_rng(0))[:, :2] * 0.999
    s, t = (p.T + 1) / 2
    normal = np.stack([2 * s - 1, 2 * t - 1, np.sqrt(1 - (2 * s - 1) ** 2 - (2 * t - 1) ** 2)], -1)
    x, y, z = normal.T
    np.testing.assert_allclose(spheremap.normals(p), normal, atol=1e-12)
    mirror = np.stack([2 * x * z, 2 * y * z, 2 * z * z - 1], -1)
    np.testing.assert_allclose(spheremap.mirrored(normal), mirror, atol=1e-12)
    for inverse, direction in ((spheremap.from_normal, normal), (spheremap.from_mirror, mirror)):
        back = np.stack(inverse(tuple(direction.T), (9.0, 9.0)), -1)
        np.testing.assert_allclose(back, p, atol=1e-7)


def test_inverses_at_their_singular_directions() -> None:
    away: Any = np.array([[0.0], [0.0], [-1.0]])
    for inverse in (spheremap.from_mirror, spheremap.from_normal):
        assert np.stack(inverse(tuple(away), (0.6, 0.8))).ravel().tolist() == [0.6, 0.8]
    behind: Any = np.array([[0.48], [0.64], [-0.6]])
    np.testing.assert_allclose(np.ravel(spheremap.from_normal(tuple(behind), (1.0, 0.0))), [0.6, 0.8])


def test_frames_turn_right_up_and_towards_the_viewer() -> None:
    for view in (*uniform(5, np.random.default_rng(0)), np.array([0, 0, 1.0])):
        axes = spheremap.frame(view)
        np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(axes @ [0, 0, 1], view, atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1)


def test_the_mesh_reproduces_what_is_linear() -> None:
    mesh = disk_mesh(6, 16)
    values = mesh.vertices @ [2.0, -3.0] + 1
    p = spheremap.texels(16).reshape(-1, 2)
    inside = np.linalg.norm(p, axis=1) < np.cos(np.pi / 24)  # within the polygon
    found = np.sum(values[mesh.corners[:, :3]] * mesh.shares[:, :3], 1)
    np.testing.assert_allclose(found[inside], (p @ [2.0, -3.0] + 1)[inside], atol=1e-5)
    assert mesh.shares.min() > -1e-6


# --- the whole ------------------------------------------------------------------------------------------------------

VERTEX = icosahedron.sphere(12)[0][3]
EDGE = normalised(icosahedron.sphere(12)[0][icosahedron.sphere(12)[1][0, :2]].sum(0))
MIDDLE = normalised(icosahedron.sphere(12)[0][icosahedron.sphere(12)[1][0]].sum(0))
VIEWS = {"vertex": VERTEX, "edge": EDGE, "middle": MIDDLE, "pole": np.array([0.0, 0.0, 1.0])}


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS.keys())
@pytest.mark.parametrize(
    "lobes",
    [
        (Phong(exponent=20, clipped=False),),
        (Lambertian(reflectance=(0.5, 1, 0.2)),),
        (Lambertian(), Phong(exponent=6, clipped=False)),
    ],
    ids=["phong", "lambertian", "both"],
)
def test_radially_symmetric_lobes_are_right_from_any_view(lobes: tuple[Lobe, ...], view: Array) -> None:
    """The warp matches them exactly (sec. 3.2), so that only two lookups err: 2 / size of the RMS (`tolerance`)."""
    viewer, points = seen_from(view)
    found = rendered(fast(), light(), viewer, points, *lobes)
    assert nrmse(found, integrated(light(), points, *lobes)) < 2 / 48 + 2e-3


def test_at_a_vertex_any_lobe_is_its_own_map() -> None:
    """Weights are 1, 0, 0 there: nothing is warped, and only the lookups of the two maps err."""
    viewer, points = seen_from(VERTEX)
    for lobe in (Phong(exponent=20), Microfacet(sigma=0.3), KajiyaKay(exponent=8)):
        found = rendered(fast(), light(), viewer, points, lobe)
        assert nrmse(found, integrated(light(), points, lobe)) < 2 / 48 + 2e-3


@pytest.mark.parametrize("lobe", [Microfacet(sigma=0.3), KajiyaKay(exponent=8)], ids=repr)
def test_more_maps_bring_any_lobe_nearer(lobe: Lobe) -> None:
    viewer, points = seen_from(MIDDLE)
    truth = integrated(light(), points, lobe)
    errors = [nrmse(rendered(fast(maps=maps), light(), viewer, points, lobe), truth) for maps in (12, 42)]
    assert errors[1] < 0.7 * errors[0]


def test_shrm_fills_the_maps_as_integration_does() -> None:
    viewer, points = seen_from(MIDDLE)
    lobe = Phong(exponent=12, clipped=False)
    filled = [
        rendered(Cabral(size=32, prefilter=kind, eps=1e-4, light_rows=0), light(), viewer, points, lobe)
        for kind in ("shrm", "angular")
    ]
    # sqrt(eps) of SHRM's energy; point samples pi / 48 apart against the bilinear light: (pi / 48)^2 / 6 and 1e-4
    assert nrmse(*filled) < 1e-2 + (np.pi / 48) ** 2 / 6 + 1e-4


def test_the_rim_is_not_darkened() -> None:
    """Constant light and a whole lobe: each map is constant, beyond the disk too, at every view and its grazing R."""
    lobe = Phong(exponent=16, clipped=False)
    for view in VIEWS.values():
        viewer, points = seen_from(view)
        grazing = np.sin(np.radians(89.99)) * normalised(np.cross(view, uniform(20, np.random.default_rng(1))))
        normal = normalised(grazing + np.cos(np.radians(89.99)) * view)
        points = Points(normal, normal, normal, perpendicular(normal), np.tile(view, (20, 1)), np.full(20, 1 / 20))
        found = rendered(fast(size=16), constant(), viewer, points, lobe)
        # the cone's edge cuts texels: of the whole, half a texel's ring of the lobe there, and eps
        np.testing.assert_allclose(found, 1, atol=0.02)


@pytest.mark.parametrize("fade", [0.0, 0.5])
@pytest.mark.parametrize("mesh", [0, 12])
def test_at_the_singular_directions_all_is_finite_and_bounded(fade: float, mesh: int) -> None:
    """R opposite to a source's view, R = -V, and N facing away from a source: within what the maps hold."""
    view = normalised(EDGE + 1e-9)
    vertices, _ = icosahedron.sphere(12)
    face, _ = icosahedron.subtended(12, view)
    opposite = -vertices[face]
    normal = normalised(
        np.concatenate([opposite + view, opposite + view + 1e-7, uniform(9, np.random.default_rng(0)) + view])
    )
    points = Points(
        normal, normal, normal, perpendicular(normal), np.tile(view, (len(normal), 1)), np.full(len(normal), 1 / 15)
    )
    viewer = Viewer(direction=(float(view[0]), float(view[1]), float(view[2])))
    method = fast(size=16, fade=fade, mesh=mesh)
    lobes = (Lambertian(), Phong(exponent=20))
    relit = method.relight(method.prepare(Material("m", lobes), SPHERE), light())
    found = method.shade(method.frame(relit, viewer), points)
    assert np.isfinite(found).all()
    assert found.min() >= 0
    assert found.max() <= sum(maps.max() for maps in relit.maps) * (1 + 1e-5)


def test_fading_mends_what_a_source_cannot_show() -> None:
    """Normals that face away from a source are taken from its rim without the fade: many times the error."""
    viewer, points = seen_from(MIDDLE)
    truth = integrated(light(), points, Lambertian())
    with_fade, without = (nrmse(rendered(fast(fade=f), light(), viewer, points, Lambertian()), truth) for f in (0.5, 0))
    assert with_fade < 0.5 * without


def test_a_finer_mesh_comes_nearer_to_the_exact_warp() -> None:
    viewer, points = seen_from(MIDDLE)
    lobe = Phong(exponent=20, clipped=False)
    exact = rendered(fast(), light(), viewer, points, lobe)
    errors = [nrmse(rendered(fast(mesh=rings), light(), viewer, points, lobe), exact) for rings in (4, 16)]
    assert errors[1] < 0.5 * errors[0]


def test_hard_lights_give_finite_results() -> None:
    pixel = np.zeros((8, 16, 3), np.float32)
    pixel[0, 0] = 1e8
    tiny = np.random.default_rng(0).random((3, 5, 3)).astype(np.float32)
    viewer, points = seen_from(MIDDLE)
    for radiance in (pixel, tiny, np.ones((2, 4, 3), np.float32)):
        for lobe in (Phong(exponent=1e5), Microfacet(sigma=0.01), Lambertian()):
            found = rendered(fast(size=8), Environment("hard", radiance), viewer, points, lobe)
            assert np.isfinite(found).all()
            assert found.min() >= 0


def test_an_eye_sees_along_its_axis() -> None:
    points, viewer = views.build({"kind": "image", "size": 24, "eye": [0, -40, 0], "fov": 3.0}, SPHERE)
    lobe = Microfacet(sigma=0.3)
    found = rendered(fast(), light(), viewer, points, lobe)
    distant = rendered(fast(), light(), Viewer(direction=(0.0, -1.0, 0.0)), points, lobe)
    np.testing.assert_allclose(found, distant, rtol=1e-5)


def test_what_it_declines() -> None:
    points, viewer = views.build({"kind": "image", "size": 4, "direction": [0, 0, 1]}, SPHERE)

    def scene(who: Viewer | None, lobe: Lobe) -> Scene:
        return Scene("s", light(), Material("m", (lobe,)), SPHERE, points, who)

    assert Cabral().declines(scene(viewer, Phong())) is None
    assert "one viewer" in str(Cabral().declines(scene(None, Phong())))


def test_each_centre_has_its_maps_and_a_forced_warp_shares_them() -> None:
    lobes = (Lambertian(), Phong(exponent=20, clipped=False), Phong(exponent=5, clipped=False))
    for warp, groups in (("auto", 2), ("mirror", 1), ("normal", 1)):
        prepared = fast(warp=warp).prepare(Material("m", lobes), SPHERE)
        assert len(prepared.groups) == groups
    viewer, points = seen_from(MIDDLE)
    truth = integrated(light(), points, *lobes)
    own, *shared = (
        nrmse(rendered(fast(warp=w), light(), viewer, points, *lobes), truth) for w in ("auto", "mirror", "normal")
    )
    assert own < min(shared)


def test_states_are_pickled_and_deterministic() -> None:
    method, (viewer, points) = fast(size=16, mesh=4), seen_from(MIDDLE)
    relit = method.relight(method.prepare(Material("m", (Lambertian(), Phong())), SPHERE), light())
    framed = method.frame(relit, viewer)
    again = pickle.loads(pickle.dumps(method.frame(pickle.loads(pickle.dumps(relit)), viewer)))
    np.testing.assert_array_equal(method.shade(framed, points), method.shade(again, points))


@pytest.mark.parametrize("lobe", [Lambertian(), Phong(exponent=32), Microfacet(), KajiyaKay(exponent=8)], ids=repr)
def test_it_keeps_the_laws(lobe: Lobe) -> None:
    method = Cabral(size=32, prefilter="angular", light_rows=32)
    assert laws.check(method, Material("m", (lobe,))) == []


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"maps": 20}, "maps must be 12, 42 or 162. Got 20"),
        ({"size": 2}, r"size must lie in \[4, 1024\]. Got 2"),
        ({"prefilter": "magic"}, "prefilter must be one of 'shrm', 'angular'. Got 'magic'"),
        ({"warp": "none"}, "warp must be one of 'auto', 'mirror', 'normal'"),
        ({"mesh": 1}, r"mesh must be 0 \(exact\) or lie in \[2, 64\]"),
        ({"fade": -0.1}, r"fade must lie in \[0, 2\]"),
        ({"eps": 1.0}, r"eps must lie in \(0, 1\)"),
        ({"light_rows": 1}, r"light_rows must be 0 or lie in \[2, 8192\]"),
        ({"maps": 162, "size": 1024}, "would take 2.5 GiB; lower maps or size"),
    ],
)
def test_settings_out_of_range_are_named(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        Cabral(**settings)
