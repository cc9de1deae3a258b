"""Where methods, suites and what they name come from: the benchmark root, installed packages, a user's own folder."""

from __future__ import annotations

import importlib
import inspect
import re
import sys
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any, cast

from envbench.catalogue import Catalogue
from envbench.errors import BadInput, CannotRun, unknown
from envbench.method import Method

CATALOGUE, REPORT, PAPERS, METHODS = "envbench.catalogue", "envbench.report", "envbench.papers", "envbench.methods"
"""Entry-point groups: what the benchmark root offers, its report writer, its papers; methods of installed packages."""
USER_PACKAGE = "envbench_user_methods"
"""The package under which the files of a user's ``methods/`` are imported, here and in workers."""


@dataclass(frozen=True)
class Workbench:
    """All that a suite may name.

    Attributes
    ----------
    catalogue : Catalogue
        What the benchmark root offers; `methods` and `suites` hold its own and the user's.
    broken : dict of str to str
        Files (or entry points) of methods that cannot be used, with the reason in one line.
    """

    catalogue: Catalogue
    methods: dict[str, type[Method]]
    suites: dict[str, Path]
    broken: dict[str, str]

    def method(self, name: str) -> type[Method]:
        """Return the method called `name`; if a broken file seems to hold it, its own trouble is raised."""
        if name in self.methods:
            return self.methods[name]
        for place, reason in self.broken.items():
            if _mentions(Path(place), name):
                raise BadInput(reason)
        raise unknown("method", name, self.methods)

    def suite(self, name: str) -> Path:
        """Return the file of the suite called `name`, or `name` itself where it is a path."""
        if name in self.suites:
            return self.suites[name]
        if name.endswith(".toml") or "/" in name or "\\" in name:
            return Path(name)
        raise unknown("suite", name, self.suites)


def find() -> Path:
    """Return the benchmark root: the checkout that this engine lies in, else the working directory.

    Raises
    ------
    CannotRun
        Neither holds the folder `benchmarks`.
    """
    for folder in (Path(__file__).resolve().parents[2], Path.cwd()):
        if (folder / "benchmarks" / "__init__.py").is_file():
            return folder
    raise CannotRun(f"no folder 'benchmarks' beside envbench or in {Path.cwd()}: run from a checkout of envbench.")


def enter() -> None:
    """Make the folders of the benchmark root importable."""
    root = str(find())
    if root not in sys.path:
        sys.path.insert(0, root)


def offered(group: str) -> Any:
    """Return what the benchmark root offers under an entry-point group; the engine names no folder above it."""
    enter()
    points = [point for point in metadata.entry_points(group=group) if point.dist and point.dist.name == "envbench"]
    if not points:
        raise CannotRun(f"envbench is installed without its entry point '{group}': install it again, e.g. 'uv sync'.")
    return points[0].load()


def load(user: Path | None = None) -> Workbench:
    """Load the catalogue, the methods of installed packages, and a user's folder with ``methods/`` and ``suites/``.

    Idempotent; the parent and each worker call it, so that either can unpickle the other's methods.

    Raises
    ------
    BadInput
        `user` is no folder.
    """
    catalogue = cast("Catalogue", offered(CATALOGUE))
    bench = Workbench(catalogue, dict(catalogue.methods), dict(catalogue.suites), {})
    for point in metadata.entry_points(group=METHODS):
        _add_entry_point(bench, point)
    if user is not None:
        _add_folder(bench, user)
    return bench


def _add_entry_point(bench: Workbench, point: metadata.EntryPoint) -> None:
    what = f"entry point {point.name} = {point.value}"
    try:
        loaded: object = point.load()
        if not (isinstance(loaded, type) and issubclass(loaded, Method)):
            raise BadInput(f"{what} is no subclass of envbench.method.Method; point it at one.")
        _register(bench, loaded, what)
    except BadInput as error:
        bench.broken[what] = str(error)
    except Exception as error:
        bench.broken[what] = f"{what} does not import: {_one_line(error)}. Mend or uninstall its package."


def _add_folder(bench: Workbench, user: Path) -> None:
    if not user.is_dir():
        raise BadInput(f"--root {user} is no folder; give the one that holds your methods/ and suites/.")
    user = user.resolve()
    for path in sorted((user / "suites").glob("*.toml")):
        bench.suites[path.stem] = path
    folder = user / "methods"
    _use_package(folder)
    for path in sorted(folder.glob("*.py")):
        if path.stem.startswith("_"):
            continue
        try:
            for cls in _methods_of(path):
                _register(bench, cls, str(path))
        except BadInput as error:
            bench.broken[str(path)] = str(error)


def _use_package(folder: Path) -> None:
    """Make `folder` the package of the user's methods, and forget those of any folder used before."""
    package = sys.modules.get(USER_PACKAGE)
    if package is None or list(package.__path__) != [str(folder)]:
        for name in [name for name in sys.modules if name.startswith(f"{USER_PACKAGE}.")]:
            del sys.modules[name]
        package = sys.modules[USER_PACKAGE] = ModuleType(USER_PACKAGE)
        package.__path__ = [str(folder)]
    importlib.invalidate_caches()


def _methods_of(path: Path) -> Iterator[type[Method]]:
    name = f"{USER_PACKAGE}.{path.stem}"
    try:
        module = importlib.import_module(name)
    except (Exception, SystemExit) as error:
        line = _line_in(path, error)
        raise BadInput(f"{path}, line {line} does not import: {_one_line(error)}. Mend the file.") from error
    for cls in vars(module).values():
        if isinstance(cls, type) and issubclass(cls, Method) and cls.__module__ == name:
            yield cls


def _register(bench: Workbench, cls: type[Method], place: str) -> None:
    """Add a method under its name, once it is whole: named, a dataclass, and lacking no step."""
    if "name" not in dir(cls):
        if inspect.isabstract(cls):
            return  # a base class of the user's own
        raise BadInput(f'{place}: class {cls.__name__} has no name; add a line  name = "..."  to it.')
    lacking = sorted(cast("frozenset[str]", getattr(cls, "__abstractmethods__", frozenset())))
    line = inspect.getsourcelines(cls)[1]
    if lacking:
        raise BadInput(f"{place}, line {line}: method '{cls.name}' lacks the step {', '.join(lacking)}; define it.")
    if "__dataclass_fields__" not in dir(cls):
        raise BadInput(f"{place}, line {line}: method '{cls.name}' must be a dataclass; add @dataclass(frozen=True).")
    holder = bench.methods.get(cls.name, cls)
    if holder is not cls:
        raise BadInput(
            f"{place}, line {line}: the name '{cls.name}' is taken by {holder.__module__}.{holder.__name__}; "
            "choose another one."
        )
    bench.methods[cls.name] = cls


def _line_in(path: Path, error: BaseException) -> int:
    if isinstance(error, SyntaxError) and error.filename == str(path):
        return error.lineno or 1
    lines = [f.lineno or 1 for f in traceback.extract_tb(error.__traceback__) if f.filename == str(path)]
    return lines[-1] if lines else 1


def _one_line(error: BaseException) -> str:
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"{type(error).__name__}: {' '.join(text.split())}".rstrip(": ").rstrip(".")


def _mentions(path: Path, name: str) -> bool:
    """Whether a file that could not be imported seems to define the method `name`."""
    if not path.is_file():
        return False
    quoted = re.compile(rf"""name\b[^=\n]*=\s*["']{re.escape(name)}["']""")
    return path.stem == name or bool(quoted.search(path.read_text(encoding="utf-8", errors="replace")))
