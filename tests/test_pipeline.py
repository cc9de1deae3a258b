"""The parts together, on inputs that the default suite does not name: meshes, cameras, generated light, many lobes."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh

from envbench import root, session, suite
from envbench.progress import Lines
from envbench.records import Status
from envbench.session import Options
from envbench.store import Store
from envbench.supervisor import Limits

SUITE = """
[reference]
floor = 0.05
[timing]
rounds = 1
[lights.few]
kind = "lamps"
count = 3
seed = 5
size = 16
[lights.sky]
kind = "sunsky"
size = 32
[materials.two]
lobes = [{{ kind = "phong", exponent = 20, clipped = false }}, {{ kind = "microfacet", sigma = 0.3 }}]
[geometries.ring]
kind = "mesh"
path = "{ring}"
[geometries.ball]
kind = "mesh"
path = "{ball}"
[views.eye]
kind = "image"
size = 24
eye = [0, -4, 1.5]
fov = 40
[views.queries]
kind = "uniform"
count = 64
[[scenes]]
lights = ["few", "sky"]
materials = ["plastic"]
geometry = "ring"
view = "eye"
[[scenes]]
lights = ["few"]
materials = ["two"]
geometry = "ball"
view = "eye"
[[scenes]]
lights = ["sky"]
materials = ["two"]
geometry = "sphere"
view = "queries"
[[methods]]
name = "shrm"
[[methods]]
name = "angular"
light_rows = 16
rows = 8
directions = 4
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wide")
    trimesh.creation.torus(1.0, 0.4, major_sections=24, minor_sections=12).export(folder / "ring.ply")
    trimesh.creation.icosphere(3).export(folder / "ball.obj")
    text = SUITE.format(ring=folder / "ring.ply", ball=folder / "ball.obj")
    (folder / "wide.toml").write_text(text)
    session.run(Options(str(folder / "wide.toml"), folder / "out", None, False, Limits(100.0, None)), Lines())
    return folder / "out"


def test_all_cells_are_scored(finished: Path) -> None:
    with Store.open(finished / session.STORE) as store:
        run = store.run("latest").id
        cells = store.cells(run)
        scenes = {scene.name: scene for scene in store.scenes(run)}
    assert len(cells) == 8
    assert [cell.reason for cell in cells if cell.status is not Status.OK] == []
    assert all(scene.reference_floor <= 0.05 for scene in scenes.values())
    ring = scenes["few/plastic/ring/eye"]
    assert "self-shadowing" in ring.effects
    lacking = {cell.scene for cell in cells if "self-shadowing" in cell.lacks}
    assert lacking == {name for name in scenes if "/ring/" in name}


def test_the_report_is_written(finished: Path) -> None:
    page = session.write_report(finished / session.STORE, "latest", finished / "report.html").read_text()
    assert "self-shadowing" in page


def test_suites_that_ship_are_read() -> None:
    bench = root.load()
    for path in bench.suites.values():
        found = suite.read(path)
        assert found.methods or found.studies
