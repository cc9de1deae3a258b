"""The store gives back what it was given, survives SIGKILL, and says in one line what is wrong with a file."""

import json
import math
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from envbench.errors import BadInput
from envbench.records import (
    CellResult,
    Film,
    MaterialSheet,
    Phase,
    Picture,
    RunInfo,
    SceneResult,
    Score,
    Status,
    Study,
    Timing,
)
from envbench.scene import Basis, Decision, Effect
from envbench.schema import MIGRATIONS
from envbench.store import Store

RUN = RunInfo("a1f0", "quick", "name = 'quick'\n", "2026-01-02T03:04:05", {"cores": 2}, {"numpy": "2.2"})
IMAGE = np.random.default_rng(0).standard_normal((5, 7, 3)).astype(np.float32)
IMAGE[0, :3] = np.nan, np.inf, 1e-42
SCENE = SceneResult(
    name="grace phong", light="grace", material="phong", geometry="sphere", view="front",
    specs={"light": {"kind": "file"}}, effects=("view dependence",), points=35, reference_key="f00d",
    reference_floor=1e-3, reference_target=1e-3, reference_samples=512, reference_replicates=8, reference_seconds=0.1,
    reference_from_cache=True, reference_rms=math.pi, notes=("one", "two"), image=IMAGE,
)  # fmt: skip
CELL = CellResult(
    key="k1", scene="grace phong", method="shrm", settings={"epsilon": 0.1, "orders": None}, status=Status.OK,
    reason="as asked", timings=(Timing(Phase.RELIGHT, 0.5, (0.1, 0.3, 0.2)), Timing(Phase.PREPARE, 1 / 3)),
    scores=(
        Score("nrmse", 0.1, 0.05, 0.15, True, (0.1, 1 / 3)), Score("energy_ratio", 1.5),
        Score("psnr", math.inf, 0.0, 1.0),
    ),
    bytes=2**40, predictions={"captured BRDF energy": 0.01}, description={"F": 12},
    lacks=("interreflection",), image=IMAGE,
)  # fmt: skip


@pytest.fixture
def path(tmp_path):
    return tmp_path / "results.sqlite"


@pytest.fixture
def store(path):
    with Store.open(path, create=True) as store:
        store.begin(RUN)
        yield store


@pytest.fixture
def unprivileged():
    """A folder, and a process that cannot write where the folder's mode forbids it: root could."""
    folder = Path(tempfile.mkdtemp())
    user = os.geteuid()
    if user == 0:
        os.chown(folder, 65534, 65534)
        os.seteuid(65534)
    yield folder
    os.seteuid(user)
    folder.chmod(0o700)
    shutil.rmtree(folder)


def same(a, b):
    """Equal in every field; NaN equals NaN."""
    return all(np.array_equal(x, y, equal_nan=True) if isinstance(x, np.ndarray) else repr(x) == repr(y)
               for x, y in ((getattr(a, f.name), getattr(b, f.name)) for f in fields(a)))  # fmt: skip


def test_records_come_back_exactly(store, path):
    plain = replace(SCENE, name="points only", image=None, reference_floor=math.nan, reference_from_cache=False)
    failed = CellResult("k2", "grace phong", "angular", {}, Status.TIMED_OUT, "after 120 s")
    for scene in (SCENE, plain):
        store.save_scene(RUN.id, scene)
    for cell in (CELL, failed):
        store.save_cell(RUN.id, cell)
    with Store.open(path) as again:
        assert again.run("latest") == RUN
        assert all(map(same, again.scenes(RUN.id), (SCENE, plain)))
        assert all(map(same, again.cells(RUN.id), (CELL, failed)))
        assert again.cells(RUN.id)[0].image.dtype == np.float32
        assert again.scene_names(RUN.id) == [SCENE.name, "points only"]
        assert again.finished_keys(RUN.id) == {"k1", "k2"}
        assert again.cells("no such run") == again.scenes("no such run") == []


def test_numpy_numbers_are_kept_as_numbers(store):
    score = Score("nrmse", np.float64(0.1), np.float32(0.5), 1.0, np.bool_(True))
    store.save_cell(RUN.id, replace(CELL, settings={"F": np.int64(3)}, scores=(score,), bytes=np.int64(7)))
    cell = store.cells(RUN.id)[0]
    assert (cell.settings, cell.bytes, cell.scores[0]) == ({"F": 3}, 7, Score("nrmse", 0.1, 0.5, 1.0, True))


def test_the_newest_save_of_a_key_counts(store):
    store.save_scene(RUN.id, SCENE)
    store.save_scene(RUN.id, replace(SCENE, points=7))
    store.save_cell(RUN.id, CELL)
    store.save_cell(RUN.id, replace(CELL, status=Status.FAILED, scores=(), timings=()))
    assert [s.points for s in store.scenes(RUN.id)] == [7]
    assert [(c.status, c.scores, c.timings) for c in store.cells(RUN.id)] == [(Status.FAILED, (), ())]


def test_runs_are_found_by_beginning(store):
    store.begin(replace(RUN, id="a1b2"))
    store.finish("a1b2", "2026-01-02T04:00:00", 60.5, 3.25)
    assert [r.id for r in store.runs()] == ["a1f0", "a1b2"]
    latest = store.run("latest")
    assert (latest.id, latest.finished, latest.wall_seconds, latest.overhead_seconds) == (
        "a1b2", "2026-01-02T04:00:00", 60.5, 3.25,
    )  # fmt: skip
    assert store.run("a1f").id == "a1f0"
    with pytest.raises(BadInput, match=r"'a1' is the beginning of more than one run .*a1b2, a1f0\."):
        store.run("a1")
    for ref in ("zz", ""):
        with pytest.raises(BadInput, match=f"'{ref}' is no run .*say 'latest' or one of a1b2, a1f0"):
            store.run(ref)
    with pytest.raises(BadInput, match=r"run 'a1b2' is in .* already"):
        store.begin(replace(RUN, id="a1b2"))


def test_no_run_yet(path):
    with Store.open(path, create=True) as store, pytest.raises(BadInput, match="holds no run yet"):
        store.run("latest")


def test_the_view_for_sql_has_a_row_a_cell(store, path):
    store.save_scene(RUN.id, SCENE)
    store.save_cell(RUN.id, CELL)
    store.save_cell(RUN.id, CellResult("k2", "gone", "angular", {}, Status.FAILED, "why"))
    user = sqlite3.connect(path)
    rows = user.execute(
        "SELECT light, method, settings ->> 'epsilon', nrmse, energy_ratio, relight_seconds, prepare_seconds, status"
        " FROM results"
    ).fetchall()
    user.close()
    assert rows == [
        ("grace", "shrm", 0.1, 0.1, 1.5, 0.2, 1 / 3, "ok"),
        (None, "angular", None, None, None, None, None, "failed"),
    ]


def test_a_reader_sees_finished_cells_while_a_run_writes(store, path):
    with Store.open(path) as reader:
        store.save_cell(RUN.id, CELL)
        assert reader.finished_keys(RUN.id) == {"k1"}


WRITER = """
import sys
import numpy as np
from envbench.records import *
from envbench.store import Store

store = Store.open(sys.argv[1], create=True)
if not store.runs():
    store.begin(RunInfo("r", "quick", "", "now", {}, {}))
number = len(store.finished_keys("r"))
image = np.zeros((32, 32, 3), np.float32)
while True:
    scores = tuple(Score(name, number) for name in ("nrmse", "mse"))
    timings = tuple(Timing(phase, number) for phase in Phase)
    store.save_cell("r", CellResult(str(number), "s", "m", {}, Status.OK, "", timings, scores, image=image + number))
    print(number, flush=True)
    number += 1
"""


def test_kill_9_loses_no_committed_cell(path):
    chance, said = random.Random(0), []
    for _ in range(4):
        with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True) as process:
            said.append(int(process.stdout.readline()))
            time.sleep(chance.uniform(0, 0.1))
            process.send_signal(signal.SIGKILL)
            said += [int(line) for line in process.stdout if line.endswith("\n")]
    with Store.open(path) as store:
        cells = {int(c.key): c for c in store.cells("r")}
    assert len(said) > 4
    assert len(set(said)) == len(said)  # none repeated
    assert set(said) <= set(cells) == set(range(len(cells)))  # none lost
    assert len(cells) <= len(said) + 4  # a kill may come between commit and word
    for number, cell in cells.items():
        assert [s.value for s in cell.scores] == [number] * 2
        assert [t.first for t in cell.timings] == [number] * 4
        assert (cell.image == number).all()
    check = sqlite3.connect(path)
    assert check.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    check.close()


LATER = ("ALTER TABLE cell ADD COLUMN colour TEXT", "UPDATE cell SET colour = 'grey'")


def colours(path):
    user = sqlite3.connect(path)
    rows = user.execute("SELECT user_version, colour FROM cell, pragma_user_version").fetchall()
    user.close()
    return rows


def test_a_store_is_led_to_a_later_schema(store, path, monkeypatch):
    store.save_cell(RUN.id, CELL)
    store.close()
    monkeypatch.setattr("envbench.database.MIGRATIONS", [*MIGRATIONS, LATER])
    with Store.open(path) as later:
        assert later.finished_keys(RUN.id) == {"k1"}
    assert colours(path) == [(len(MIGRATIONS) + 1, "grey")]
    Store.open(path).close()
    assert colours(path) == [(len(MIGRATIONS) + 1, "grey")]


def test_schema_1_kept_one_prediction_a_cell(path):
    old = sqlite3.connect(path)
    for statement in MIGRATIONS[0]:
        old.execute(statement)
    old.execute("PRAGMA user_version = 1")
    old.execute("INSERT INTO run VALUES (1, 'r', 's', '', '2026', '{}', '{}', NULL, NULL, NULL)")
    for key, predicted in (("with", 0.25), ("without", None)):
        old.execute(
            "INSERT INTO cell VALUES (NULL, 'r', ?, 's', 'm', '{}', 'ok', '', 0, ?, '{}', '[]', NULL, NULL, NULL)",
            (key, predicted),
        )
    old.commit()
    old.close()
    with Store.open(path) as store:
        found = {cell.key: cell.predictions for cell in store.cells("r")}
    assert found == {"with": {"captured BRDF energy": 0.25}, "without": {}}


def test_sheets_come_back_as_saved(store):
    sheet = MaterialSheet(
        "skin", {"kind": "lafortune"}, ("lobe",), ("note",), 0.01, 0.0, ((0.0, 0.1, 0.2, 0.3),),
        ((0.1, 0, 12, 4, 0.09),), ((0, 1, 0.9),), ((30.0, (-10.0, 10.0), (0.1, 0.2)),),
    )  # fmt: skip
    store.save_sheet(RUN.id, sheet)
    store.save_sheet(RUN.id, sheet)
    assert store.sheets(RUN.id) == [sheet]


def test_studies_come_back_as_saved(store):
    study = Study(
        "orders", "Orders", "Beside table 5.", ("sigma (rad)", "F", "within 1", "source"),
        ((0.1, 23, True, "a"), (math.inf, 11, np.bool_(False), None)), ("note",), 1.5,
        pictures=(Picture("spheres", "radiance 0 to 1", b"PNG"),),
    )  # fmt: skip
    gone = Study.missing("gone", "timed out: no answer within 9 s")
    for saved in (gone, study, study):
        store.save_study(RUN.id, saved)
    assert all(
        map(
            same,
            store.studies(RUN.id),
            (gone, replace(study, rows=((0.1, 23, True, "a"), (math.inf, 11, False, None)))),
        )
    )
    assert store.studies(RUN.id)[1].judged == (1, 2)
    assert store.studies("no such run") == []


def test_decisions_come_back_with_their_scene(store):
    made = (Decision(Effect.INTERREFLECTION, True, Basis.PROBE, "6 %", 0.06, 0.05, 0.07, 3.0, 0.0, 0.2, 2),)
    scene = SceneResult(
        "a/b/c/d", "a", "b", "c", "d", {}, ("interreflection",), 3, "key", 0.1, 0.1, 1, 8, 1.0, False, 1.0,
        decisions=made,
    )  # fmt: skip
    store.save_scene(RUN.id, scene)
    assert store.scenes(RUN.id)[-1].decisions == made


def test_films_come_back_as_saved(store):
    film = Film("bat", "shrm, light studio", "image/webp", bytes(range(256)), ("note",), 2.5)
    gone = Film("gone", "as asked", reason="EGL is not usable")
    for saved in (film, gone, film):
        store.save_film(RUN.id, saved)
    assert all(map(same, store.films(RUN.id), (gone, film)))
    assert store.films("no such run") == []


def test_a_study_has_an_entry_a_column():
    with pytest.raises(BadInput, match=r"study 'odd': row 2 must have 2 entries, one a column. Got 1 instead."):
        Study("odd", "", "", ("a", "b"), ((1, 2), (3,)))


def test_a_migration_that_fails_leaves_the_store_as_it_was(store, path, monkeypatch):
    store.close()
    with monkeypatch.context() as later:
        later.setattr("envbench.database.MIGRATIONS", [*MIGRATIONS, (LATER[0], "nonsense")])
        with pytest.raises(BadInput, match='near "nonsense"'):
            Store.open(path)
    with Store.open(path) as again:
        assert again.run("latest") == RUN


def test_a_newer_schema_is_refused(store, path):
    store.close()
    user = sqlite3.connect(path)
    user.execute("PRAGMA user_version = 7")
    user.close()
    for create in (False, True):
        message = rf"made by a newer envbench \(schema 7, this one knows {len(MIGRATIONS)}\): upgrade envbench\."
        with pytest.raises(BadInput, match=message):
            Store.open(path, create=create)


@pytest.mark.parametrize("create", [False, True])
@pytest.mark.parametrize("content", [b"method,nrmse\nshrm,0.1\n" * 100, b"x"])
def test_not_sqlite(path, content, create):
    path.write_bytes(content)
    with pytest.raises(BadInput, match=r"results\.sqlite is no SQLite file"):
        Store.open(path, create=create)
    assert path.read_bytes() == content


def test_sqlite_of_another_program(path):
    other = sqlite3.connect(path)
    other.execute("CREATE TABLE bookmark (url TEXT)")
    other.close()
    before = path.read_bytes()
    with pytest.raises(BadInput, match="no store of envbench"):
        Store.open(path, create=True)
    assert path.read_bytes() == before


def test_a_damaged_store(store, path):
    store.save_cell(RUN.id, replace(CELL, image=np.random.default_rng(0).random((64, 64, 3)).astype(np.float32)))
    store.close()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(BadInput, match="is damaged"), Store.open(path) as again:
        again.cells(RUN.id)


def test_nothing_there(tmp_path):
    with pytest.raises(BadInput, match=r"there is no store at .*none\.sqlite: make one with 'envbench run'"):
        Store.open(tmp_path / "none.sqlite")
    assert not (tmp_path / "none.sqlite").exists()
    (tmp_path / "empty.sqlite").touch()
    with pytest.raises(BadInput, match="is empty"):
        Store.open(tmp_path / "empty.sqlite")
    with pytest.raises(BadInput, match="is a folder"):
        Store.open(tmp_path)


def test_a_file_where_the_folder_should_be(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(BadInput, match=r"file/results\.sqlite cannot be used: (Not a directory|File exists)"):
        Store.open(tmp_path / "file" / "results.sqlite", create=True)


def test_a_full_disk_keeps_earlier_cells(store, path):
    store.save_cell(RUN.id, CELL)
    pages = store._db.execute("PRAGMA page_count").fetchone()[0]
    store._db.execute(f"PRAGMA max_page_count = {pages}")  # SQLite then fails as it does where the disk is full
    large = np.random.default_rng(0).random((64, 64, 3)).astype(np.float32)
    with pytest.raises(BadInput, match=r"the disk is full: free some space, then go on with --resume"):
        store.save_cell(RUN.id, replace(CELL, key="k2", image=large))
    store.close()
    with Store.open(path) as again:
        assert again.finished_keys(RUN.id) == {"k1"}


def test_a_read_only_folder_can_be_read_but_not_written(unprivileged):
    path = unprivileged / "results.sqlite"
    with Store.open(path, create=True) as store:
        store.begin(RUN)
    unprivileged.chmod(0o555)
    with Store.open(path) as store:
        assert store.run("latest") == RUN
        with pytest.raises(BadInput, match=r"cannot be written: make the file and its folder writable"):
            store.save_cell(RUN.id, CELL)
    for new in (path, unprivileged / "new.sqlite"):
        with pytest.raises(BadInput, match="cannot be written"):
            Store.open(new, create=True)


def test_a_read_only_file_can_be_read_but_not_written(unprivileged):
    path = unprivileged / "results.sqlite"
    with Store.open(path, create=True) as store:
        store.begin(RUN)
    path.chmod(0o444)
    with Store.open(path) as store:
        assert store.run("latest") == RUN
        with pytest.raises(BadInput, match="cannot be written"):
            store.save_cell(RUN.id, CELL)
    with pytest.raises(BadInput, match="cannot be written"):
        Store.open(path, create=True)


def test_a_store_in_use_elsewhere(store, path):
    with Store.open(path) as other:
        other._db.execute("PRAGMA busy_timeout = 10")
        store._db.execute("BEGIN IMMEDIATE")
        with pytest.raises(BadInput, match="is being written by another process"):
            other.save_cell(RUN.id, CELL)
        store._db.execute("ROLLBACK")


def test_settings_keep_their_order(store):
    store.save_cell(RUN.id, replace(CELL, settings={"z": 1, "a": [1, {"b": None}]}))
    assert json.dumps(store.cells(RUN.id)[0].settings) == '{"z": 1, "a": [1, {"b": null}]}'
