"""The benchmark root and a user's own folder."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from envbench import root
from envbench.errors import BadInput
from tests.envbench.conftest import UserFolder


def test_our_methods_and_suites_are_there() -> None:
    bench = root.load()
    assert {"shrm", "angular"} <= set(bench.methods)
    assert bench.suite("quick").is_file()
    assert not bench.broken


def test_a_users_methods_and_suites_stand_beside_ours(user: UserFolder) -> None:
    user.method("beside")
    user.suite("mine", "")
    bench = root.load(user.path)
    assert {"shrm", "beside"} <= set(bench.methods)
    assert bench.suite("mine").parent == user.path / "suites"
    method = bench.method("beside")(number=3)  # pyright: ignore[reportCallIssue]
    assert pickle.loads(pickle.dumps(method)) == method
    assert set(root.load(user.path).methods) == set(bench.methods)


def test_a_base_class_of_the_users_own_is_no_method(user: UserFolder) -> None:
    path = user.method("derived")
    path.write_text(
        path.read_text().replace(
            "class Own(Method)", "class Base(Method):\n    pass\n\n@dataclass(frozen=True)\nclass Own(Base)", 1
        )
    )
    bench = root.load(user.path)
    assert "derived" in bench.methods
    assert not bench.broken


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("import numpy\nimport nonesuch\n", 2, "No module named 'nonesuch'"),
        ("x = 1\ndef f(:\n    pass\n", 2, "SyntaxError"),
        ("raise SystemExit(3)\n", 1, "SystemExit: 3"),
    ],
)
def test_a_file_that_does_not_import(user: UserFolder, text: str, line: int, said: str) -> None:
    path = user.file("wrecked", text)
    bench = root.load(user.path)
    assert bench.method("shrm")
    with pytest.raises(BadInput) as caught:
        bench.method("wrecked")
    message = str(caught.value)
    assert f"{path}, line {line} " in message
    assert said in message
    assert "Mend the file" in message


def test_a_broken_file_is_found_by_the_name_it_would_have_given(user: UserFolder) -> None:
    user.file("elsewhere", 'import nonesuch\nclass A:\n    name: ClassVar[str] = "wanted"\n')
    with pytest.raises(BadInput, match="nonesuch"):
        root.load(user.path).method("wanted")
    with pytest.raises(BadInput, match="unknown method 'angle': did you mean 'angular'"):
        root.load(user.path).method("angle")


HEAD = "from dataclasses import dataclass\nfrom envbench.method import Method\n"
STEPS = "    prepare = relight = shade = lambda self, *given: None\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            HEAD + '@dataclass(frozen=True)\nclass A(Method):\n    name = "a"\n    prepare = relight = None\n',
            "lacks the step shade",
        ),
        (HEAD + f'class A(Method):\n    name = "a"\n{STEPS}', "must be a dataclass"),
        (HEAD + f"@dataclass(frozen=True)\nclass A(Method):\n{STEPS}", "has no name"),
        (HEAD + f'@dataclass(frozen=True)\nclass A(Method):\n    name = "shrm"\n{STEPS}', "name 'shrm' is taken"),
    ],
)
def test_a_class_that_is_no_whole_method(user: UserFolder, text: str, said: str) -> None:
    path = user.file("a", text)
    (reason,) = root.load(user.path).broken.values()
    assert str(path) in reason
    assert said in reason
    assert "\n" not in reason


def test_a_file_may_be_named_as_one_of_ours(user: UserFolder) -> None:
    user.file("angular", HEAD + f'@dataclass(frozen=True)\nclass A(Method):\n    name = "mine"\n{STEPS}')
    assert {"mine", "angular", "shrm"} <= set(root.load(user.path).methods)


def test_folders_do_not_mix(tmp_path: Path) -> None:
    """One file name in two folders: each load sees its own."""
    for folder in ("one", "two"):
        text = HEAD + f'@dataclass(frozen=True)\nclass A(Method):\n    name = "{folder}"\n{STEPS}'
        (tmp_path / folder / "methods").mkdir(parents=True)
        (tmp_path / folder / "methods" / "a.py").write_text(text)
    for folder, other in (("one", "two"), ("two", "one")):
        methods = root.load(tmp_path / folder).methods
        assert folder in methods
        assert other not in methods


def test_a_root_that_is_no_folder(user: UserFolder) -> None:
    with pytest.raises(BadInput, match="is no folder"):
        root.load(user.path / "nonesuch")
