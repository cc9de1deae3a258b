"""Errors split on a real concave shape, by the whole run: parts are the total's, and methods do what is called for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from envbench import root, session, suite
from envbench.metrics import score
from envbench.plan import plan
from envbench.progress import Lines
from envbench.records import CellResult, Score, Status
from envbench.reference import ReferenceSettings
from envbench.session import Options
from envbench.store import Store
from envbench.supervisor import Limits
from tests.envbench.conftest import call

SUITE = """
[reference]
floor = 0.01
budget = 20.0
bounces = 2
[timing]
rounds = 1
[views.above]
kind = "image"
size = 24
direction = [0.2, -0.7, 0.9]
[geometries.bumps]
kind = "patch"
texture = "bumps"
tiles = 2
size = 1.0
resolution = 25
height = 0.15
pose = { kind = "wave", amplitude = 0.1 }
[materials.white]
kind = "lambertian"
reflectance = [0.8, 0.8, 0.8]
[[scenes]]
lights = ["studio"]
materials = ["white"]
geometry = "bumps"
view = "above"
effects = ["self-shadowing", "interreflection", "deformation"]
[[scenes]]
lights = ["studio"]
materials = ["white"]
geometry = "bumps"
view = "above"
effects = ["self-shadowing"]
[[methods]]
name = "shrm"
[[methods]]
name = "ldprt"
rays = 200
[[methods]]
name = "ldprt"
transfer = "unshadowed"
"""
PARTS = ("missing_effects", "approximation", "cross")


@dataclass(frozen=True)
class Finished:
    """A finished run: its folder, its suite, its cells by scene's effects and label."""

    folder: Path
    suite: Path
    cells: dict[tuple[str, str], CellResult]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    folder = tmp_path_factory.mktemp("split")
    (folder / "split.toml").write_text(SUITE)
    session.run(Options(str(folder / "split.toml"), folder / "out", None, False, Limits(200.0, None)), Lines())
    with Store.open(folder / "out" / session.STORE) as store:
        cells = store.cells(store.run("latest").id)
    assert [cell.reason for cell in cells if cell.status is not Status.OK] == []
    return Finished(folder / "out", folder / "split.toml", {(c.scene.split("[")[1][:-1], c.label): c for c in cells})


def squares(cell: CellResult) -> dict[str, np.ndarray]:
    """Return value, lower and upper end of each part, roots squared."""
    found: dict[str, Score] = {s.metric: s for s in cell.scores}
    return {
        name: np.array([s.value, s.low, s.high]) ** (1 if name == "cross" else 2)
        for name, s in found.items()
        if name in ("nrmse", *PARTS)
    }


ALL = "deformation, interreflection, self-shadowing"


def test_each_method_is_split_by_what_it_lacks(finished: Finished) -> None:
    lacks = {key: set(cell.lacks) for key, cell in finished.cells.items()}
    bare = "ldprt(transfer=unshadowed)"
    assert lacks == {
        (ALL, "shrm"): {"self-shadowing", "interreflection", "deformation"},
        (ALL, "ldprt(rays=200)"): {"deformation"},
        (ALL, bare): {"self-shadowing", "interreflection", "deformation"},
        ("self-shadowing", "shrm"): {"self-shadowing"},
        ("self-shadowing", "ldprt(rays=200)"): set(),
        ("self-shadowing", bare): {"self-shadowing"},
    }
    for key, cell in finished.cells.items():
        assert (set(PARTS) <= set(squares(cell))) == bool(lacks[key]), key


def test_parts_are_the_total_against_a_reference_of_other_noise(finished: Finished) -> None:
    """Against the run's own reference the parts are the total to rounding; another seed's knows nothing of them."""
    bench = root.load()
    scenes = {spec.name: spec for spec in plan(suite.read(finished.suite), bench).scenes}
    for cell in finished.cells.values():
        if not cell.lacks:
            continue
        parts = squares(cell)
        total, low, high = parts["nrmse"]
        summed = parts["missing_effects"] + parts["approximation"] + 2 * parts["cross"]
        assert summed[0] == pytest.approx(total, rel=1e-9)
        assert low <= summed[0] <= high
        scene = scenes[cell.scene].build(bench.catalogue)
        other = bench.catalogue.reference(scene, ReferenceSettings(0.01, 20.0, seed=1, bounces=2), None)
        assert scene.points.pixel is not None
        assert cell.image is not None
        radiance = cell.image[scene.points.pixel[:, 0], scene.points.pixel[:, 1]]
        (again,) = score(radiance, other, scene.points, ["nrmse"])
        # Each estimate is normal about one truth: their difference has the sum of their variances. Both intervals are
        # of 95 %; at 1.7 times their joint width, p is 1e-3 for each of five.
        joint = np.hypot((high - low) / 2, (again.high**2 - again.low**2) / 2)
        assert abs(summed[0] - again.value**2) < 1.7 * joint


def test_what_is_ignored_does_not_depend_on_who_ignores_it(finished: Finished) -> None:
    ignored = [
        {s.metric: s.value for s in finished.cells[ALL, label].scores}["missing_effects"]
        for label in ("shrm", "ldprt(transfer=unshadowed)")
    ]
    assert ignored[0] == ignored[1] > 0.02


def test_auto_is_recorded(finished: Finished) -> None:
    label = "ldprt(rays=200)"
    told = [finished.cells[effects, label].description for effects in (ALL, "self-shadowing")]
    assert [(t["transfer"], t.get("bounces")) for t in told] == [("interreflected", 1), ("shadowed", None)]
    assert finished.cells[ALL, "shrm"].description["lobes"] == ["about N: F = 2, P = 0, q <= 0, radially symmetric"]


def test_show_says_both(finished: Finished) -> None:
    code, out, _ = call("show", "latest", "--out", finished.folder)
    assert code == 0
    assert " % [" in out
    assert " in what it does," in out
    assert " in what it ignores (deformation)" in out
