"""What is paid once an asset is paid once; and what a survey keeps of materials."""

from __future__ import annotations

from pathlib import Path

import pytest

from envbench import session
from envbench.progress import Lines
from envbench.records import MaterialSheet, Phase, Status
from envbench.session import Options
from envbench.store import Store
from envbench.supervisor import Limits
from tests.envbench.conftest import UserFolder, call, forget

LIGHTS = ("grey", "constant")


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[Store, str]:
    """Give a run of two lights on two materials, with a log of all calls of `prepare`, and a survey."""
    folder = tmp_path_factory.mktemp("assets")
    user = UserFolder(folder / "own")
    path = user.method("counts")
    calls = folder / "calls"
    path.write_text(
        path.read_text().replace(
            "return np.zeros(8)", f"open({str(calls)!r}, 'a').write(material.name + ' '); return np.zeros(8)"
        )
    )
    suite = user.suite("assets", '[[methods]]\nname = "counts"\n[survey]\n')
    text = suite.read_text().replace('["lambertian"]', '["lambertian", "phong"]')
    suite.write_text(text.replace('["grey"]', '["grey", "constant"]').replace("rounds = 3", "rounds = 2"))
    options = Options("assets", user.path / "out", user.path, limits=Limits(60.0))
    session.run(options, Lines())
    forget(folder)
    return Store.open(user.path / "out" / session.STORE), calls.read_text()


def test_prepare_is_paid_once_for_all_lights(ran: tuple[Store, str]) -> None:
    store, calls = ran
    cells = store.cells(store.run("latest").id)
    assert {cell.status for cell in cells} == {Status.OK}
    assert calls.split() == ["lambertian"] * 3 + ["phong"] * 3  # a first pass and two rounds
    prepare = {cell.scene: next(t for t in cell.timings if t.phase is Phase.PREPARE) for cell in cells}
    for material in ("lambertian", "phong"):
        first, later = (prepare[f"{light}/{material}/sphere/tiny"] for light in LIGHTS)
        assert (first.shared, later.shared) == (False, True)
        assert (first.first, first.rounds) == (later.first, later.rounds)
        assert len(first.rounds) == 2


def test_what_is_stored_stands_in_the_order_of_the_plan(ran: tuple[Store, str]) -> None:
    store, _ = ran
    run = store.run("latest").id
    names = [f"{light}/{material}/sphere/tiny" for light in LIGHTS for material in ("lambertian", "phong")]
    assert store.scene_names(run) == names
    assert [scene.name for scene in store.scenes(run)] == names
    assert [cell.scene for cell in store.cells(run)] == names


def test_a_survey_keeps_a_sheet_of_each_material(ran: tuple[Store, str]) -> None:
    store, _ = ran
    sheets: dict[str, MaterialSheet] = {sheet.name: sheet for sheet in store.sheets(store.run("latest").id)}
    assert list(sheets) == ["lambertian", "phong"]
    # A Lambertian lobe reflects all that it receives, from wherever it is seen; it is its own reverse.
    assert all(abs(row[1] - 1) < 2e-3 for row in sheets["lambertian"].albedo)
    assert sheets["lambertian"].reciprocity < 1e-6
    # The clamped cosine holds 1 - 1/48 ... of its energy in l <= 2 (RH 2001): F = 2, P = 0.
    assert [order[2:4] for order in sheets["lambertian"].orders] == [(2, 0)] * 3
    captured = [energy for lobe, _, energy in sheets["phong"].captured if lobe == 0]
    assert captured == sorted(captured)
    assert captured[-1] <= 1 + 1e-9


def test_a_material_is_shown_with_its_plot(tmp_path: Path) -> None:
    code, out, _ = call("show", "material", "phong", "--plot", tmp_path / "phong.html")
    assert code == 0
    assert "Phong, exponent 32, about R, clipped" in out
    assert "light at 60 deg" in out
    assert any("\u2800" < character <= "\u28ff" for character in out)
    assert "plotly" in (tmp_path / "phong.html").read_text()


@pytest.mark.parametrize(("words", "said"), [
    (("material", "phnog"), "unknown material 'phnog': did you mean 'phong'"),
    (("material",), "show takes a run, or 'material NAME'"),
    (("latest", "phong"), "show takes a run, or 'material NAME'"),
    (("material", "phong", "--plot", "/nonesuch/x.html"), "cannot write the plot to '/nonesuch/x.html'"),
])  # fmt: skip
def test_what_cannot_be_shown_is_refused_in_a_line(words: tuple[str, ...], said: str) -> None:
    code, _, err = call("show", *words)
    assert code == 2
    assert said in err
    assert err.count("\n") == 1
