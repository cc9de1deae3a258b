"""The documents are true: links lead somewhere, Python runs, suites plan, commands parse, dependencies are named."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
import typer

from envbench import cli, root, suite
from envbench.plan import plan

ROOT = Path(__file__).resolve().parents[1]
STUDIO = ROOT / "docs" / "examples" / "studio"
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"^(?:uv run envbench|envbench|\./bench)(?: (.*))?$", re.MULTILINE)


def blocks(language: str) -> list[object]:
    found: list[object] = []
    for page in PAGES:
        texts = [text for kind, text in FENCE.findall(page.read_text()) if kind == language]
        found += [pytest.param(text, id=f"{page.name}-{i + 1}") for i, text in enumerate(texts)]
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    text = FENCE.sub("", page.read_text())
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
        if not target.startswith("https://"):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


@pytest.mark.parametrize("code", blocks("python"))
def test_python_runs(code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("document")
    monkeypatch.setitem(sys.modules, "document", module)  # dataclasses look there
    exec(compile(code, "<document>", "exec"), vars(module))


@pytest.mark.parametrize("text", blocks("toml"))
def test_suites_plan(text: str) -> None:
    table = tomllib.loads(text)
    if {"scenes", "studies", "animations"} & set(table):
        planned = plan(suite.parse(text, "document"), root.load())
        assert planned.cells or planned.studies or planned.animations
    elif {"lights", "materials", "geometries", "views", "reference", "timing"} & set(table):
        assert suite.parse(text, "document")


@pytest.mark.parametrize("text", blocks("sh"))
def test_commands_parse(text: str) -> None:
    commands = typer.main.get_command(cli.app).commands
    for line in COMMAND.findall(text):
        name, *arguments = shlex.split(line, comments=True) or ["--help"]
        if name not in ("--help", "test", "kernels"):  # the launcher's own
            assert commands[name].make_context(name, arguments)


def test_the_example_method_is_shown_whole_and_short() -> None:
    code = (STUDIO / "methods" / "mean_light.py").read_text()
    for page in (ROOT / "README.md", ROOT / "docs" / "add-a-method.md"):
        assert f"```python\n{code}```" in page.read_text()
    assert len(code.splitlines()) < 40


def test_the_example_method_runs(tmp_path: Path) -> None:
    """On constant light and a Lambertian sphere an ambient term is exact; on captured light it is far off."""
    from envbench.store import Store

    command = [sys.executable, "-c", "from envbench.cli import main; main()", "run", "ambient", "--no-report"]
    options = ["--root", str(STUDIO), "--out", str(tmp_path), "--rounds", "1", "--method", "mean_light"]
    done = subprocess.run(command + options, cwd=tmp_path, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stdout + done.stderr
    with Store.open(tmp_path / "envbench.sqlite") as store:
        cells = store.cells(store.run("latest").id)
    nrmse = {(c.scene.split("/")[0], c.scene.split("/")[1]): c.scores[0].value for c in cells}
    assert len(cells) == 8  # two lights, two materials, two settings
    assert nrmse["constant", "lambertian"] < 0.01  # the reference's floor in this suite
    assert nrmse["studio", "phong"] > 0.1


def test_every_dependency_is_explained() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    names = [*project["project"]["dependencies"], *project["dependency-groups"]["dev"]]
    page = (ROOT / "docs" / "dependencies.md").read_text()
    listed = {name for row in re.findall(r"^\| ([a-z0-9, -]+) \|", page, re.MULTILINE) for name in row.split(", ")}
    assert {re.split(r"[\[>=<; ]", name)[0] for name in names} == listed - {"package", "---"}
