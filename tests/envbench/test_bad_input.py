"""Bad input: one line on standard error that names thing, value and remedy; exit code 2; nothing touched."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.envbench.conftest import SUITE, UserFolder, call

OWN = '[[methods]]\nname = "own"\n'
LAST = (SUITE + OWN).count("\n") + 1


def refused(user: UserFolder, text: str, *arguments: object) -> str:
    """Return the one line with which a suite is refused."""
    path = user.suite("bad", "", text)
    code, _, err = call("run", path, "--root", user.path, "--out", user.path / "out", *arguments)
    return one_line(code, err)


def one_line(code: int, err: str) -> str:
    """Check that an error is one line with exit code 2, and return it."""
    assert code == 2, err
    assert err.count("\n") == 1
    assert err.startswith("error: ")
    return err


SUITES = {
    "unknown method": (SUITE + '[[methods]]\nname = "angula"', "unknown method 'angula': did you mean 'angular'?"),
    "unknown setting": (
        SUITE + OWN + "facter = 1.0",
        "unknown setting of method 'own': 'facter': did you mean 'factor'?",
    ),
    "wrong type": (SUITE + OWN + 'factor = "high"', "method 'own': factor must be a valid number. Got 'high' instead."),
    "out of range": (SUITE + OWN + "factor = -1.0", "method 'own': factor must be >= 0. Got -1.0 instead."),
    "swept out of range": (SUITE + OWN + "factor = [1.0, -2.0]", "factor must be >= 0. Got -2.0 instead."),
    "empty sweep": (SUITE + OWN + "factor = []", "method 'own': factor is an empty list"),
    "no method name": (SUITE + "[[methods]]\nfactor = 1.0", "needs a name in quotes. Got {'factor': 1.0}"),
    "unknown light": (SUITE.replace('["grey"]', '["gray"]') + OWN, "unknown light 'gray': did you mean 'grey'?"),
    "unknown material": (SUITE.replace("lambertian", "lambertain") + OWN, "did you mean 'lambertian'?"),
    "unknown geometry": (
        SUITE.replace('"sphere"', '"spheer"') + OWN,
        "unknown geometry 'spheer': did you mean 'sphere'?",
    ),
    "unknown view": (
        SUITE.replace('view = "tiny"', 'view = "tinny"') + OWN,
        "unknown view 'tinny': did you mean 'tiny'?",
    ),
    "unknown section": (SUITE + OWN + "[timeing]\nrounds = 1", "'timeing': did you mean 'timing'?"),
    "unknown key": (SUITE.replace("floor", "flor") + OWN, "[reference]: 'flor': did you mean 'floor'?"),
    "floor": (SUITE.replace("0.05", "5.0") + OWN, "reference floor must lie in [1e-6, 1]. Got 5.0 instead."),
    "rounds": (SUITE.replace("rounds = 3", "rounds = -3") + OWN, "rounds must lie in [0, 1000]. Got -3 instead."),
    "view too small": (SUITE.replace("size = 16", "size = 0") + OWN, "view 'tiny'"),
    "radiance": (SUITE.replace("[0.5, 1.0, 2.0]", '"bright"') + OWN, "light 'grey'"),
    "preset hidden": (SUITE.replace("grey", "studio") + OWN, "[lights.studio] hides a preset"),
    "no scene": (OWN, "names no cell: give it at least one [[scenes]]"),
    "no material": (SUITE.replace('["lambertian"]', "[]") + OWN, "names no cell"),
    "no method": (SUITE, "names no cell: give it at least one [[methods]]"),
    "missing map": (
        SUITE.replace('"constant"\nradiance = [0.5, 1.0, 2.0]', '"file"\npath = "none.exr"') + OWN,
        "none.exr",
    ),
    "malformed": (SUITE + OWN + "factor = = 2", f"bad.toml, line {LAST}, column 10: Invalid value"),
    "cut short": (SUITE + OWN + 'factor = """', f"bad.toml, line {LAST}, column "),
    "scenes no list": ("scenes = 3", "write [[scenes]], a list of tables. Got 3 instead."),
}


@pytest.mark.parametrize("case", SUITES)
def test_a_suite_is_refused_in_one_line(user: UserFolder, case: str) -> None:
    text, said = SUITES[case]
    user.method("own")
    assert said in refused(user, text)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "quik"), "unknown suite 'quik': did you mean 'quick'?"),
        (("run", "nowhere.toml"), "suite nowhere.toml does not exist"),
        (("run", "--timeout", 0), "time-out must be > 0 seconds. Got 0.0"),
        (("run", "--memory", -1), "memory limit must be > 0"),
        (("run", "--variant", "llvm_rgb", "--method", "shrm"), "'llvm_rgb': did you mean"),
        (("run", "--scene", "esplanade/fong/sphere/front"), "did you mean 'esplanade/phong/sphere/front'?"),
        (("run", "--method", "shmr"), "unknown method of this suite: 'shmr': did you mean 'shrm'?"),
        (("run", "--root", "nowhere"), "--root nowhere is no folder"),
        (("list", "method"), "unknown thing to list 'method': did you mean 'methods'?"),
        (("show", "latest"), "envbench.sqlite"),
        (("gate", "latest", "--baseline", "latest"), "envbench.sqlite"),
        (("export", "latest", "a.csv"), "envbench.sqlite"),
    ],
)
def test_a_command_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[object, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, err = call(*arguments)
    assert said in one_line(code, err)


def test_usage_errors_end_with_2() -> None:
    assert call("run", "--no-such-option")[0] == 2
    assert call("no-such-command")[0] == 2


def test_an_output_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    code, _, err = call("run", "--out", tmp_path / "file" / "out")
    assert "Give another with --out" in one_line(code, err)


def test_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The probe meets a device that is always full."""
    from envbench import session

    with Path("/dev/full").open("wb", buffering=0) as full:
        monkeypatch.setattr(session.tempfile, "TemporaryFile", lambda dir: full)
        code, _, err = call("run", "--out", tmp_path)
    assert "No space left on device" in one_line(code, err)


def test_a_store_that_is_none_stays_as_it_is(tmp_path: Path) -> None:
    store = tmp_path / "envbench.sqlite"
    store.write_text("not a store")
    code, _, err = call("run", "--out", tmp_path)
    assert str(store) in one_line(code, err)
    assert store.read_text() == "not a store"


def test_broken_methods_matter_only_to_the_suites_that_name_them(user: UserFolder) -> None:
    user.method("own", more="shade = property()").write_text("from nonesuch import x\n")
    assert "own.py, line 1 does not import" in refused(user, SUITE + OWN)


def test_a_suite_in_another_encoding(user: UserFolder) -> None:
    path = user.path / "suites" / "latin.toml"
    path.write_bytes('name = "\xe9"'.encode("latin-1"))
    assert "UTF-8" in one_line(*call("run", path)[::2])


def test_a_run_or_metric_that_is_not_there(tmp_path: Path) -> None:
    from envbench.store import Store

    Store.open(tmp_path / "envbench.sqlite", create=True).close()
    assert "no run yet" in one_line(*call("show", "latest", "--out", tmp_path)[::2])
    assert "did you mean 'nrmse'?" in one_line(*call("show", "latest", "--out", tmp_path, "--metric", "nmrse")[::2])
