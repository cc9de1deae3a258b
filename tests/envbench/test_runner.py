"""The runner: every way in which a method can end, killed runs, and what is stored.

The reference truth of the tiny scene is known: a Lambertian sphere of albedo 1 under constant light shows that light.
"""

from __future__ import annotations

import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace

import psutil
import pytest

from envbench import harmonics, root, session, suite
from envbench.errors import BadInput
from envbench.messages import Failure, MakeStudy
from envbench.plan import plan
from envbench.progress import Lines
from envbench.records import CellResult, Phase, RunInfo, SceneResult, Status
from envbench.runner import resumable
from envbench.session import Options
from envbench.store import Store
from envbench.supervisor import Limits
from tests.envbench.conftest import SCENE, UserFolder, call, forget

# Ctrl-C is ignored by what was started in the background, and so by the tests' children: they take it up again.
LAUNCH = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from envbench.cli import main; main()"
)
COMMAND = [sys.executable, "-c", LAUNCH]


def run(
    user: UserFolder, suite: str, limits: Limits | None = None, **more: object
) -> tuple[Store, dict[str, CellResult]]:
    """Run a suite of a user's folder, and return its cells by label of method."""
    options = Options(suite, user.path / "out", user.path, limits=limits or Limits(), **more)  # pyright: ignore
    info = session.run(options, Lines())
    store = session.opened(options.out)
    return store, {cell.method: cell for cell in store.cells(info.id)}


ENDS = {
    "hangs": ("time.sleep(60)", Status.TIMED_OUT, "no answer within 6 s"),
    "hogs": ("x = [np.ones(2**22) for _ in range(10**6)]", Status.OUT_OF_MEMORY, "over its limit of 1 GiB"),
    "refused": ("raise MemoryError('1 TiB')", Status.OUT_OF_MEMORY, "MemoryError: 1 TiB (refused.py:"),
    "faults": ("os.kill(os.getpid(), 11)", Status.CRASHED, "killed by SIGSEGV in shade (faults.py:"),
    "leaves": ("os._exit(0)", Status.CRASHED, "ended itself with exit code 0"),
    "raises": ("1 / 0", Status.FAILED, "ZeroDivisionError: division by zero (raises.py:"),
    "exits": ("raise SystemExit(7)", Status.FAILED, "SystemExit: 7 (exits.py:"),
    "shape": ("return np.ones((3, len(points)))", Status.FAILED, "must return shape (208, 3). Got (3, 208)"),
    "integers": ("return np.ones((len(points), 3), int)", Status.FAILED, "must return float32 or float64. Got int64"),
    "listed": ("return [[0.0] * 3] * len(points)", Status.FAILED, "must return a NumPy array"),
    "holes": ("framed = framed * np.nan", Status.FAILED, "Got NaN or infinity at 208 of 208 points"),
    "well": ("pass", Status.OK, ""),
}


def test_whatever_a_method_does_is_a_status_and_the_run_goes_on(user: UserFolder) -> None:
    for name, (shade, _, _) in ENDS.items():
        user.method(name, shade)
    user.method("declines", more="declines = lambda self, scene: 'not\\n  today'")
    user.suite("ends", "".join(f'[[methods]]\nname = "{name}"\n' for name in (*ENDS, "declines")))
    store, cells = run(user, "ends", Limits(6.0, 2**30))
    with store:
        assert {name: cell.status for name, cell in cells.items()} == {
            **{name: status for name, (_, status, _) in ENDS.items()},
            "declines": Status.DECLINED,
        }
        for name, (_, _, reason) in ENDS.items():
            assert reason in cells[name].reason
            assert "\n" not in cells[name].reason
        assert cells["declines"].reason == "not today"
        assert store.run("latest").finished is not None


@pytest.fixture(scope="module")
def timed(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunInfo, SceneResult, dict[str, CellResult]]:
    """Give a run of methods that are slow, or die late."""
    folder = tmp_path_factory.mktemp("timed")
    user = UserFolder(folder / "own")
    calls = str(folder / "calls")
    user.method("first", "time.sleep(0.01)")
    user.method("late", f"open({calls!r}, 'a').write('x'); os.path.getsize({calls!r}) >= 3 and os.abort()")
    user.method("lengthy", "time.sleep(2.2)")
    slow = user.method("slow")
    slow.write_text(slow.read_text().replace("return np.zeros(8)", "time.sleep(1.1); return np.zeros(8)"))
    names = "".join(f'[[methods]]\nname = "{name}"\n' for name in ("first", "late", "lengthy", "slow"))
    user.suite("timed", names + "factor = 1.5")
    store, cells = run(user, "timed", Limits(6.0))
    with store:
        info = store.run("latest")
        (scene,) = store.scenes(info.id)
    forget(folder)
    return info, scene, cells


def test_a_finished_cell_holds_scores_times_and_image(timed) -> None:
    info, scene, cells = timed
    good = cells["first"]
    scores = {score.metric: score for score in good.scores}
    # Constant light on an albedo of 1 is met exactly, so all that is seen is the reference's noise, at most .05.
    assert scores["nrmse"].below_floor or scores["nrmse"].value < 0.05
    assert abs(scores["energy_ratio"].value - 1) < 0.05
    assert abs({s.metric: s for s in cells["slow"].scores}["energy_ratio"].value - 1.5) < 1.5 * 0.05
    assert {timing.phase: len(timing.rounds) for timing in good.timings} == dict.fromkeys(Phase, 3)
    assert next(t for t in good.timings if t.phase is Phase.SHADE).median >= 0.01
    assert good.bytes == 3 * 8
    assert good.image is not None
    assert good.image.shape == (16, 16, 3)
    assert scene.image is not None
    assert (scene.name, scene.points) == (SCENE, 208)
    assert info.machine["threads"]["transforms"] == harmonics.threads()
    assert 0 < (info.overhead_seconds or 0) <= (info.wall_seconds or 0)


def test_a_slow_prepare_is_timed_once(timed) -> None:
    rounds = {timing.phase: len(timing.rounds) for timing in timed[2]["slow"].timings}
    assert rounds == {Phase.PREPARE: 0, Phase.RELIGHT: 3, Phase.FRAME: 3, Phase.SHADE: 3}
    assert next(t for t in timed[2]["slow"].timings if t.phase is Phase.PREPARE).median >= 1.1


def test_a_death_in_a_timing_round_costs_no_other_cell(timed) -> None:
    late = timed[2]["late"]
    assert late.status is Status.CRASHED
    assert "SIGABRT in shade (late.py:" in late.reason
    assert {cell.status for name, cell in timed[2].items() if name != "late"} == {Status.OK}


def test_rounds_stop_before_they_outrun_the_time_of_a_cell(timed) -> None:
    # The first pass and one round take 4.4 s of the 6 s; another would make it 6.6 s.
    assert {len(timing.rounds) for timing in timed[2]["lengthy"].timings} == {1}


def test_a_reference_that_fails_fails_its_cells_only(user: UserFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    from envbench.supervisor import Supervisor

    ask = Supervisor.ask

    def refuse(self: Supervisor, request: object, seconds: float) -> object:
        if getattr(getattr(request, "scene", None), "light", "") == "grey":
            return Failure(Status.CRASHED, "the process was killed by SIGSEGV")
        return ask(self, request, seconds)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(Supervisor, "ask", refuse)
    user.method("good")
    path = user.suite("two", '[[methods]]\nname = "good"')
    path.write_text(path.read_text().replace('["grey"]', '["grey", "constant"]'))
    store, _ = run(user, "two")
    with store:
        cells = {cell.scene: cell for cell in store.cells(store.run("latest").id)}
        scenes = store.scenes(store.run("latest").id)
    assert cells[SCENE].status is Status.CRASHED
    assert cells[SCENE].reason == "reference: the process was killed by SIGSEGV"
    assert cells["constant/lambertian/sphere/tiny"].status is Status.OK
    assert [scene.reference_key != "" for scene in scenes] == [False, True]


def test_a_study_that_fails_stands_with_its_reason_and_nothing_is_made_twice(
    user: UserFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name that only this process knows fails in the worker; the second is said to have killed it."""
    from benchmarks.studies import STUDIES
    from envbench.supervisor import Supervisor

    asked: list[object] = []
    ask = Supervisor.ask

    def watched(self: Supervisor, request: object, seconds: float) -> object:
        asked.append(request)
        if request == MakeStudy("captured-energy"):
            return Failure(Status.CRASHED, "the process was killed by SIGSEGV")
        return ask(self, request, seconds)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(Supervisor, "ask", watched)
    monkeypatch.setitem(STUDIES, "nowhere", STUDIES["claimed-orders"])
    user.suite("tables", "", 'studies = ["nowhere", "captured-energy", "microfacet-orders"]')
    store, cells = run(user, "tables")
    with store:
        (info,) = store.runs()
        lost, crashed, made = store.studies(info.id)
    assert (info.finished is not None, cells) == (True, {})
    assert lost.reason.startswith("failed: BadInput: unknown study 'nowhere'")
    assert crashed.reason == "crashed: the process was killed by SIGSEGV"
    assert (made.name, made.reason, len(made.rows)) == ("microfacet-orders", "", 5)
    assert made.seconds > 0
    said = call("show", "--out", user.path / "out")[1]
    assert "study 'captured-energy': no table, crashed: the process was killed" in said
    assert "table 5; 5 rows, 9 of 10 comparisons hold" in said
    assert len(asked) == 3
    run(user, "tables", resume=True)[0].close()
    assert len(asked) == 3


def start(user: UserFolder, suite: str, *more: str) -> subprocess.Popen[str]:
    """Start a run in a process group of its own."""
    command = [*COMMAND, "run", suite, "--root", user.path, "--out", user.path / "out", "--no-report", *more]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen([str(c) for c in command], **streams, text=True, start_new_session=True)


def rows(user: UserFolder) -> dict[str, tuple[object, ...]]:
    """Return every stored cell with its times, by key."""
    path = user.path / "out" / "envbench.sqlite"
    if not path.exists():
        return {}
    with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as db:
        query = (
            "SELECT key, cell.id, group_concat(rounds, ';') FROM cell JOIN timing ON cell_id = cell.id GROUP BY cell.id"
        )
        try:
            found = {row[0]: row[1:] for row in db.execute(query)}
        except sqlite3.OperationalError:  # killed before the tables were there
            found = {}
    db.close()
    return found


def test_killed_runs_resume_and_repeat_nothing(user: UserFolder) -> None:
    user.method("slowly", "time.sleep(0.05)")
    path = user.suite("long", '[[methods]]\nname = "slowly"\nnumber = [1, 2, 3, 4]')
    path.write_text(path.read_text().replace('["lambertian"]', '["lambertian", "phong-whole", "glossy"]'))
    chance = random.Random(5)
    kept: dict[str, tuple[object, ...]] = {}
    for kill in (os.kill, os.killpg):  # the parent alone, then the whole process group
        process = start(user, "long", "--resume")
        deadline = time.monotonic() + 60
        while len(rows(user)) <= len(kept) and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.02)
        time.sleep(chance.uniform(0, 0.5))
        workers = psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []
        kill(process.pid, signal.SIGKILL)
        process.communicate()
        _, alive = psutil.wait_procs(workers, timeout=10)
        assert not alive
        found = rows(user)
        assert kept.items() <= found.items()
        kept = found
    process = start(user, "long", "--resume")
    out, err = process.communicate(timeout=100)
    assert process.returncode == 0, err
    found = rows(user)
    assert kept.items() <= found.items()
    assert len(found) == 12
    with session.opened(user.path / "out") as store:
        (info,) = store.runs()
        assert info.finished is not None
    assert f"{12 - len(kept)} cells" in out or "nothing to resume" in out


def test_only_a_run_of_the_same_plan_is_resumed(user: UserFolder) -> None:
    user.method("own")
    path = user.suite("kept", '[[methods]]\nname = "own"')
    bench = root.load(user.path)
    work = plan(suite.read(path), bench)
    with Store.open(user.path / "out.sqlite", create=True) as store:
        assert resumable(store, work) is None
        store.begin(RunInfo("a", "kept", work.text, "2026", {}, {}))
        assert resumable(store, work) == store.run("a")
        with pytest.raises(BadInput, match="run a of 'kept' was begun with another suite text"):
            resumable(store, replace(work, text="another"))
        store.save_cell("a", CellResult("of another input", SCENE, "own", {}, Status.OK))
        with pytest.raises(BadInput, match="leave out --resume"):
            resumable(store, work)
        store.finish("a", "2026", 1.0, 0.5)
        assert resumable(store, work) is None


def test_interrupt_keeps_what_is_finished_and_says_how_to_go_on(user: UserFolder) -> None:
    user.method("good")
    user.method("hangs", "print('at work', flush=True); time.sleep(60)")
    user.suite("hang", '[[methods]]\nname = "good"\n[[methods]]\nname = "hangs"')
    process = start(user, "hang")
    log = user.path / "out" / "worker.log"
    while process.poll() is None and "at work" not in (log.read_text() if log.exists() else ""):
        time.sleep(0.05)
    workers = psutil.Process(process.pid).children(recursive=True)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 130
    assert err.splitlines() == ["interrupted: finished cells are kept; go on with 'envbench run hang --resume'."]
    _, alive = psutil.wait_procs(workers, timeout=10)
    assert not alive
