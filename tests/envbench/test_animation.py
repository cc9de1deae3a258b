"""Animations: what a suite may ask for, how vertices get their colours, and what stands where there is no picture."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from benchmarks.catalogue import CATALOGUE
from data_gen import views
from data_gen.geometry import build
from envbench import film, root, suite
from envbench.animation import AnimationSpec
from envbench.catalogue import Rasteriser
from envbench.errors import BadInput, CannotRun
from envbench.geometry import TriangleMesh
from envbench.plan import Plan, plan
from envbench.tonemap import exposure, pictured
from tests.envbench.conftest import SUITE, UserFolder, call
from tests.envbench.test_runner import run

PATCH = '{ kind = "patch", texture = "bumps", resolution = 9, pose = { kind = "wave", amplitude = 0.1 } }'
MOVES = f"""
[[animations]]
name = "waves"
light = "constant"
material = "lambertian"
geometry = {PATCH}
method = {{ name = "irradiance-9" }}
vary = "geometry.pose.amplitude"
values = [0.0, 0.1, 0.2]
size = 32
"""


def planned(text: str, user: UserFolder | None = None, **narrowed: tuple[str, ...]) -> Plan:
    where = None if user is None else user.path
    return plan(suite.parse(text, "t.toml"), root.load(where), **narrowed)


def spec(text: str = MOVES) -> AnimationSpec:
    (found,) = planned(text).animations
    return found


@dataclass
class Screen:
    """Keeps what it is asked to draw."""

    meshes: list[TriangleMesh] = field(default_factory=list[TriangleMesh])
    colours: list[NDArray[np.uint8]] = field(default_factory=list[NDArray[np.uint8]])
    closed: bool = False

    def film(
        self,
        meshes: Sequence[TriangleMesh],
        colours: Sequence[NDArray[np.uint8]],
        direction: Sequence[float],
        up: Sequence[float],
        fps: float,
    ) -> tuple[str, bytes]:
        self.meshes, self.colours = list(meshes), list(colours)
        return "image/none", b"film"

    def close(self) -> None:
        self.closed = True


@dataclass(frozen=True)
class Drawing(type(CATALOGUE)):  # pyright: ignore[reportUntypedBaseClass]
    """The catalogue, with a rasteriser of the test's."""

    make: Callable[[], Rasteriser] = Screen

    def rasteriser(self, size: int) -> Rasteriser:
        return self.make()


def test_frames_are_scenes_of_the_pose_at_each_value() -> None:
    made = spec()
    assert [frame.specs["geometry"]["pose"]["amplitude"] for frame in made.frames] == [0.0, 0.1, 0.2]
    assert {frame.specs["view"]["kind"] for frame in made.frames} == {"vertices"}
    assert made.caption == (
        "irradiance-9, light constant, material lambertian, geometry its own mesh; geometry.pose.amplitude = 0 ... 0.2 "
        "in 3 frames, 12 a second, seen from (0, -1, 0)"
    )
    glossy = spec(MOVES.replace("lambertian", "phong").replace('"irradiance-9"', '"shrm", eps = 0.1'))
    assert {tuple(frame.specs["view"]["direction"]) for frame in glossy.frames} == {(0.0, -1.0, 0.0)}
    assert glossy.caption.startswith("shrm(eps=0.1), ")


def test_a_suite_may_hold_animations_beside_scenes_or_alone(user: UserFolder) -> None:
    user.method("own")
    both = SUITE + MOVES + '[[methods]]\nname = "own"\n'
    assert len(planned(both, user).animations) == 1
    assert planned(both, user, methods=("own",)).animations == ()
    assert planned(MOVES).cells == ()


REFUSED = {
    "unknown method": ('"irradiance-9"', '"irradiance"', "unknown method 'irradiance': did you mean 'irradiance-9'"),
    "setting": ('"irradiance-9"', '"irradiance-9", order = 3', "unknown setting of method 'irradiance-9': 'order'"),
    "several": ('"irradiance-9"', '"shrm", eps = [0.1, 0.2]', "animation 'waves': method must be one, with one value"),
    "no name": ('{ name = "irradiance-9" }', "{ eps = 0.1 }", "method must be a table with the name of a method"),
    "light": ('"constant"', '"constantly"', "unknown light 'constantly': did you mean 'constant'"),
    "vary the rest": ("geometry.pose.amplitude", "geometry.resolution", "vary must lead into the pose"),
    "vary the light": ("geometry.pose.amplitude", "light", "vary must lead into the pose"),
    "nowhere": ("pose.amplitude", "pose.bones.0", "animation 'waves': 'geometry.pose.bones.0' leads nowhere"),
    "pose": ("pose.amplitude", "pose.hight", "unknown setting of pose (wave): 'hight'"),
    "one frame": ("[0.0, 0.1, 0.2]", "[0.0]", "values must hold two frames at least. Got [0.0] instead."),
    "no vertices": (PATCH, '"sphere"', "leads nowhere in the geometry's table {'kind': 'sphere'}"),
    "direction": ("size = 32", "direction = [0.0, 0.0, 0.0]", "direction must be a finite vector that is not zero"),
    "size": ("size = 32", "size = 8", "size must lie in [16, 2048] pixels. Got 8 instead."),
    "pace": ("size = 32", "fps = 0.0", "fps must lie in [0.1, 60] frames a second. Got 0 instead."),
    "name": ('"waves"', '"a/b"', "an animation's name must be words without '/'. Got 'a/b' instead."),
    "lacking": ('light = "constant"', "", "[[animations]] 1 lacks 'light': add it."),
    "twice": ("size = 32", MOVES, "two [[animations]] are called 'waves'"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_makes_no_sense_is_refused_before_anything_is_computed(what: str) -> None:
    old, new, message = REFUSED[what]
    assert old in MOVES
    with pytest.raises(BadInput) as told:
        planned(MOVES.replace(old, new))
    assert message in str(told.value)
    assert "knob" not in str(told.value)


def test_data_that_are_absent_leave_it_out_where_that_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ENVBENCH_DATA", "/nonexistent")
    bat = MOVES.replace(PATCH, '"bat-flying"').replace("pose.amplitude", "pose.time")
    with pytest.raises(BadInput, match=r"bat\.npz is neither there"):
        planned(bat)
    work = planned(
        bat + "optional = true\n[[animations]]" + MOVES.split("[[animations]]")[1].replace("waves", "others")
    )
    assert [made.name for made in work.animations] == ["others"]
    assert work.notes[0].startswith("left out animation 'waves': geometry 'waves = 0': meshes/bat.npz is neither there")


def test_values_lie_at_their_vertices() -> None:
    shape = build({"kind": "patch", "texture": "bumps", "resolution": 9, "pose": {"kind": "wave", "amplitude": 0.3}})
    points, _ = views.build({"kind": "vertices", "direction": [0.9, -0.4, 0.1]}, shape)
    mesh = shape.posed.mesh
    assert mesh is not None
    assert len(points) < len(mesh.vertices)  # some face away
    found = film.at_vertices(points.position, points, mesh)
    seen = ~np.isnan(found[:, 0])
    assert seen.sum() == len(points)
    assert np.allclose(found[seen], mesh.vertices[seen])


def test_vertices_without_a_value_take_their_neighbours_and_far_ones_none() -> None:
    strip = np.array([[i, i + 1, i + 2] for i in range(18)], np.int32)
    values = np.full((20, 3), np.nan)
    values[:2] = [[2.0, 0, 1], [4.0, 0, 1]]
    found = film.spread(values, strip)
    assert found[2] == pytest.approx([(2 + 2 * 4) / 3, 0, 1])  # the second of the two shares two triangles with it
    assert np.isfinite(found[:10]).all()  # four edges, of two vertices each
    assert np.isnan(found[10:]).all()


def test_colours_are_the_radiance_at_one_exposure() -> None:
    """Constant light on a Lambertian patch shows that light everywhere, in every frame."""
    screen = Screen()
    made = film.film(spec(), Drawing(make=lambda: screen))
    assert (made.mime, made.data, made.reason, screen.closed) == ("image/none", b"film", "", True)
    assert len(screen.meshes) == len(screen.colours) == 3
    radiance = CATALOGUE.scene(name="c", **spec().frames[0].specs).environment.radiance[0, :1].astype(float)
    expected = pictured(radiance, exposure(radiance))[0].astype(int)
    assert np.abs(np.concatenate(screen.colours).astype(int) - expected).max() <= 1
    flat, waved = screen.meshes[0].vertices, screen.meshes[-1].vertices
    assert np.abs(flat - waved).max() == pytest.approx(0.2, rel=0.1)
    assert "EV, clipped to [0, 1], sRGB curve" in made.caption
    assert made.seconds > 0


def test_a_method_that_declines_and_a_machine_without_egl_leave_their_reason() -> None:
    def without() -> Rasteriser:
        raise CannotRun("EGL is not usable: apt install libegl1.")

    glossy = spec(MOVES.replace("lambertian", "phong"))
    declined = film.film(glossy, Drawing())
    assert (declined.reason, declined.data) == ("declined: holds Lambertian lobes only", b"")
    left_out = film.film(replace(glossy), Drawing(make=without))
    assert left_out.reason == "EGL is not usable: apt install libegl1."


def test_a_run_keeps_animations_and_resumes_without_them(user: UserFolder) -> None:
    user.method("breaks", "1 / 0")
    broken = MOVES.replace("waves", "broken").replace("irradiance-9", "breaks")
    user.suite("moves", "", MOVES + broken)
    store, _ = run(user, "moves")
    with store:
        (info,) = store.runs()
        waves, lost = store.films(info.id)
    assert info.finished is not None
    assert lost.reason.startswith("failed: ZeroDivisionError: division by zero (breaks.py:")
    if waves.reason:
        assert "apt install libegl1" in waves.reason
    else:
        assert Image.open(io.BytesIO(waves.data)).n_frames == 3
    said = call("show", "--out", user.path / "out")[1]
    assert "animation 'waves'" in said
    assert "animation 'broken': left out, failed: ZeroDivisionError" in said
    again, _ = run(user, "moves", resume=True)
    with again:
        assert [kept.seconds for kept in again.films(info.id)] == pytest.approx(
            [waves.seconds, lost.seconds], nan_ok=True
        )
        assert len(again.runs()) == 1
