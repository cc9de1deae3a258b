"""Patches and surfaces of revolution: periodic, normals of the height field, windings, pictures as heights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from skimage import io

from data_gen.boundary import is_closed
from data_gen.geometry import GEOMETRIES, build
from data_gen.geometry.reliefs import RELIEFS, groove, picture, slopes
from envbench.directions import normalised
from envbench.errors import BadInput, NeedsData
from envbench.geometry import Geometry, TriangleMesh


def mesh_of(geometry: Geometry) -> TriangleMesh:
    assert geometry.mesh is not None
    return geometry.mesh


@pytest.mark.parametrize("name", [*RELIEFS, "groove"])
def test_reliefs_are_periodic_heights_between_0_and_1(name: str) -> None:
    relief = groove(0.3, 0.6) if name == "groove" else RELIEFS[name]
    s, t = np.random.default_rng(0).uniform(0, 1, (2, 20000))
    h = relief(s, t)
    assert h.min() >= -1e-12
    assert h.max() <= 1 + 1e-12
    assert np.ptp(h) > 0.85
    for shift in ((1, 0), (0, 1), (-3, 2)):
        np.testing.assert_allclose(relief(s + shift[0], t + shift[1]), h, atol=1e-9)


def test_a_wrinkle_is_a_sinusoidal_groove_of_its_depth_at_its_location() -> None:
    spec = {"kind": "patch", "texture": "wrinkle", "depth": 0.3, "location": 0.25, "width": 0.5, "resolution": [101, 5]}
    mesh = mesh_of(build(spec))
    x, z = mesh.vertices[:, 0], mesh.vertices[:, 2]
    inside = x <= 0.5
    np.testing.assert_allclose(z[inside], -0.15 * (1 + np.cos(2 * np.pi * (x[inside] - 0.25) / 0.5)), atol=1e-12)
    np.testing.assert_allclose(z[~inside], 0, atol=1e-12)
    assert z.min() == pytest.approx(-0.3)


@pytest.mark.parametrize("texture", [*RELIEFS, "wrinkle"])
def test_patches_have_the_normals_of_their_triangles(texture: str) -> None:
    geometry = build({"kind": "patch", "texture": texture, "resolution": 257, "size": [2, 1.5], "tiles": [2, 1]})
    mesh = mesh_of(geometry)
    assert not geometry.convex
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    assert cross[:, 2].min() > 0  # counter-clockwise from above
    assert cross[:, 2].sum() / 2 == pytest.approx(2 * 1.5)
    cosine = np.sum(normalised(cross)[:, None] * mesh.normals[mesh.triangles], axis=2)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 2
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.uv * [2, 1.5], mesh.vertices[:, :2])


def test_a_flat_patch_shadows_nothing() -> None:
    geometry = build({"kind": "patch", "texture": "bumps", "height": 0})
    assert geometry.convex
    np.testing.assert_array_equal(mesh_of(geometry).normals, np.broadcast_to([0.0, 0, 1], (64 * 64, 3)))


def test_a_picture_becomes_heights(tmp_path: Path) -> None:
    """A smooth periodic picture, given back at its pixels' centres; its slopes from the spline."""
    rows, columns = 48, 64
    s, t = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    grey = 0.5 + 0.3 * np.sin(2 * np.pi * s) * np.cos(2 * np.pi * t)
    np.save(tmp_path / "a.npy", np.repeat(grey[..., None], 3, axis=2))
    relief = picture(tmp_path / "a.npy", 64)
    np.testing.assert_allclose(relief(s, t), grey, atol=5e-3)  # smoothed by a quarter of a pixel
    np.testing.assert_allclose(relief(s + 1, t - 1), relief(s, t), atol=1e-9)
    expected = 0.6 * np.pi * np.cos(2 * np.pi * s) * np.cos(2 * np.pi * t)
    np.testing.assert_allclose(slopes(relief, s, t)[0], expected, atol=0.03)


def test_the_detail_of_a_picture_is_what_its_samples_hold(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (128, 128)).astype(np.uint8)
    io.imsave(tmp_path / "noise.png", noise, check_contrast=False)
    rough = build({"kind": "patch", "image": str(tmp_path / "noise.png"), "resolution": 129, "height": 0.1})
    smooth = build({"kind": "patch", "image": str(tmp_path / "noise.png"), "resolution": 17, "height": 0.1})
    assert np.ptp(mesh_of(smooth).vertices[:, 2]) < 0.5 * np.ptp(mesh_of(rough).vertices[:, 2])
    with pytest.raises(NeedsData, match=r"nowhere\.png"):
        build({"kind": "patch", "image": "nowhere.png"})


@pytest.mark.parametrize("kind", ["cylinder", "vase", "torus"])
def test_surfaces_of_revolution_face_outward(kind: str) -> None:
    mesh = mesh_of(build({"kind": kind, "resolution": [65, 33]}))
    assert len(mesh.vertices) == 65 * 33
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    cross = normalised(np.cross(b - a, c - a))
    assert np.sum(cross[:, None] * mesh.normals[mesh.triangles], axis=2).min() > 0.9
    middle = (a + b + c) / 3
    axis = normalised(middle * [1, 1, 0]) * (1.0 if kind == "torus" else 0.0)
    assert np.sum(cross * (middle - axis), axis=1).mean() > 0


def test_a_torus_has_its_volume_and_area() -> None:
    mesh = mesh_of(build({"kind": "torus", "radius": 1.0, "tube": 0.4, "resolution": 257}))
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    assert np.sum(a * np.cross(b, c)) / 6 == pytest.approx(2 * np.pi**2 * 0.4**2, rel=1e-3)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(4 * np.pi**2 * 0.4, rel=1e-3)


@pytest.mark.parametrize("name", ["ellipsoid", "walls", "bowl", "tube"])
def test_presets_that_face_a_side_are_wound_as_their_normals_say(name: str) -> None:
    mesh = mesh_of(build(GEOMETRIES[name], name))
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    facing = normalised(np.cross(b - a, c - a))
    assert all((np.sum(facing * mesh.normals[mesh.triangles[:, k]], axis=1) > 0).all() for k in range(3))
    outward = np.sum((mesh.vertices - mesh.vertices.mean(0)) * mesh.normals, axis=1)
    assert (outward > 0).all() if name == "ellipsoid" else outward.mean() < 0  # the others are seen from within


def test_an_ellipsoid_nears_its_volume() -> None:
    mesh = mesh_of(build({"kind": "ellipsoid", "axes": [1.0, 0.8, 0.6], "subdivisions": 5}))
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    volume = np.sum(a * np.cross(b, c)) / 6
    assert volume == pytest.approx(4 / 3 * np.pi * 0.48, rel=2e-3)


def test_walls_face_each_other_across_their_gap() -> None:
    mesh = mesh_of(build({"kind": "walls", "size": [2.0, 1.0], "gap": 0.25, "resolution": 4}))
    left, right = np.split(mesh.vertices, 2)
    assert np.ptp(mesh.vertices, axis=0).tolist() == [0.25, 2.0, 1.0]
    assert (left[:, 0] == -0.125).all()
    assert (right[:, 0] == 0.125).all()


@pytest.mark.parametrize("name", ["slab-waffle", "slab-waffle-bent"])
def test_a_slab_is_closed_and_faces_outwards(name: str) -> None:
    slab = build(GEOMETRIES[name], name)
    for mesh in (slab.mesh, slab.posed.mesh):
        assert mesh is not None
        assert is_closed(mesh)
        a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
        across = np.cross(b - a, c - a)
        assert (np.sum(across * mesh.normals[mesh.triangles[:, 0]], axis=1) > 0).all()
        assert np.sum(a * np.cross(b, c)) > 0


def test_a_flat_slab_is_a_box() -> None:
    box = build({
        "kind": "patch", "texture": "bumps", "height": 0.0, "size": [2.0, 1.0], "resolution": [5, 3], "thickness": 0.5,
    })  # fmt: skip
    assert box.mesh is not None
    assert box.convex
    assert np.ptp(box.mesh.vertices, axis=0) == pytest.approx([2, 1, 0.5])
    a, b, c = (box.mesh.vertices[box.mesh.triangles[:, k]] for k in range(3))
    assert np.sum(a * np.cross(b, c)) / 6 == pytest.approx(1.0)


def test_too_coarse_a_patch_is_said() -> None:
    geometry = build({"kind": "patch", "texture": "weave", "tiles": 16})
    assert geometry.notes == (
        "3.9 vertices a tile cannot hold its relief; a resolution of 8 a tile or more is needed.",
    )


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({"kind": "patch"}, "either a texture or an image; give exactly one"),
        ({"kind": "patch", "texture": "weave", "image": "a.png"}, "give exactly one of them"),
        ({"kind": "patch", "texture": "waeve"}, "unknown texture 'waeve': did you mean 'weave'"),
        ({"kind": "patch", "image": 3}, "image must name a file. Got 3 instead."),
        (
            {"kind": "patch", "texture": "weave", "resolution": 1},
            r"resolution must be an integer in \[2, 2048\]. Got 1",
        ),
        ({"kind": "patch", "texture": "weave", "resolution": [4, 4, 4]}, "resolution must be one integer or two"),
        ({"kind": "patch", "texture": "weave", "tiles": 1.5}, "tiles must be an integer"),
        ({"kind": "patch", "texture": "weave", "size": 0}, "size must be a number"),
        ({"kind": "patch", "texture": "weave", "thickness": 0}, "thickness must be a number"),
        ({"kind": "patch", "texture": "weave", "depth": 0.1}, "depth is no setting of this texture: a wrinkle has it."),
        ({"kind": "patch", "texture": "wrinkle", "height": 0.1}, "height is no setting of a wrinkle."),
        ({"kind": "patch", "texture": "weave", "height": float("inf")}, "height must be a number"),
        ({"kind": "walls", "gap": 0}, "gap must be a number"),
        ({"kind": "ellipsoid", "axes": [1, 1, 0]}, "axes must be three lengths > 0"),
        ({"kind": "ellipsoid", "subdivisions": 20}, r"subdivisions must be an integer in \[0, 8\]. Got 20"),
        (
            {"kind": "vase", "profile": [[-1, 0], [1, 1]]},
            "geometry 'g': profile must be at least two pairs of a radius",
        ),
        ({"kind": "torus", "radius": 0.1}, "tube must be less than radius, 0.1. Got 0.4"),
        ({"kind": "torus", "resolution": 9999}, "resolution must be an integer"),
        ({"kind": "vase", "radius": 1}, r"unknown setting of geometry 'g' \(vase\)"),
    ],
)
def test_wrong_tables_are_refused(spec: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        build(spec, "g")
