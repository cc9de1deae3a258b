"""Distant light: read from files, captured and shipped, or generated; named presets in `LIGHTS`."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from data_gen.environments import parameters
from data_gen.environments import projected as projection
from data_gen.environments.daylight import sunsky
from data_gen.environments.files import read
from data_gen.environments.generated import band_limited, constant, lamps, noise, pixel
from data_gen.environments.interior import hall
from data_gen.environments.layouts import Layout
from data_gen.environments.resample import downsampled
from data_gen.external import locate
from envbench.environment import Environment
from envbench.errors import BadInput, unknown

__all__ = ["KINDS", "LIGHTS", "Layout", "build", "captured", "downsampled", "read"]

CAPTURED = Path(__file__).resolve().parent.parent / "captured"
"""The maps that are shipped, with their credits."""


def captured(*, name: str, size: int | None = None) -> Environment:
    """Return a map of the folder `CAPTURED` by its name, reduced to `size` rows if it has more."""
    paths = {path.stem: path for path in CAPTURED.glob("*.exr")}
    if name not in paths:
        raise unknown("captured light", str(name), paths)
    return _reduced("captured", read(paths[name]), size)


def file(*, path: str, layout: str = Layout.LATLONG, size: int | None = None) -> Environment:
    """Return the map of a file (`read`), reduced to `size` rows if it has more.

    A relative `path` begins in the working directory, else in the data folder (`data_gen.external`).
    """
    if not isinstance(path, str | Path):  # pyright: ignore[reportUnnecessaryIsInstance] - it comes from TOML
        raise BadInput(f"The 'path' of light 'file' must be a string. Got {path!r} instead.")
    return _reduced("file", read(path if Path(path).is_absolute() else locate(path), layout), size)


def projected(
    *, of: str | None = None, light: Mapping[str, Any] | None = None, order: int = 6, window: str = "none",
    size: int | None = None,
) -> Environment:  # fmt: skip
    """Return a light, a preset's name or a table, projected to `order` bands on a map of `size` rows."""
    return projection.project(build(projection.source(of, light, LIGHTS)), order, window, size)


def _reduced(kind: str, environment: Environment, size: int | None) -> Environment:
    if size is None:
        return environment
    rows, columns = environment.radiance.shape[:2]
    height = parameters.integer(kind, "size", size, 2, parameters.MAX_ROWS)
    if height >= rows:
        return environment
    note = f"reduced from {columns} x {rows} to {height} rows, each sample the mean over its pixel"
    return replace(downsampled(environment, height), notes=(*environment.notes, note))


KINDS: Mapping[str, Callable[..., Environment]] = {
    "captured": captured,
    "file": file,
    "constant": constant,
    "pixel": pixel,
    "noise": noise,
    "lamps": lamps,
    "band-limited": band_limited,
    "hall": hall,
    "sunsky": sunsky,
    "projected": projected,
}
"""Every kind of light, by the function whose keyword arguments are its settings."""

LIGHTS: dict[str, dict[str, Any]] = {
    "esplanade": {"kind": "captured", "name": "esplanade"},
    "studio": {"kind": "captured", "name": "studio"},
    "workshop": {"kind": "captured", "name": "workshop"},
    "constant": {"kind": "constant"},
    "pixel": {"kind": "pixel", "row": 20, "column": 30},
    "noise": {"kind": "noise"},
    "lamps": {"kind": "lamps"},
    "band-limited": {"kind": "band-limited"},
    "hall": {"kind": "hall"},
    "sunsky": {"kind": "sunsky"},
    "esplanade-6": {"kind": "projected", "of": "esplanade", "order": 6},
    "studio-6": {"kind": "projected", "of": "studio", "order": 6},
    "workshop-6": {"kind": "projected", "of": "workshop", "order": 6},
}


def build(spec: Mapping[str, Any]) -> Environment:
    """Make the light that `spec` describes.

    Parameters
    ----------
    spec : mapping
        `kind`, one of `KINDS`; the settings of that kind; and `scale`, a factor of radiance, if wanted.

    Raises
    ------
    BadInput
        For an unknown kind or setting (the known ones are listed), one that is missing, or a value out of range.

    Examples
    --------
    >>> build({"kind": "constant", "radiance": 0.5, "size": 8}).radiance.shape
    (8, 16, 3)
    """
    settings = dict(spec)
    kind = settings.pop("kind", None)
    if not isinstance(kind, str) or kind not in KINDS:
        raise unknown("kind of light", str(kind), KINDS)
    scale = parameters.number(kind, "scale", settings.pop("scale", 1.0), 1e-12, 1e12)
    signature = inspect.signature(KINDS[kind])
    for key in settings.keys() - signature.parameters.keys():
        raise unknown(f"setting of light '{kind}'", key, [*signature.parameters, "scale"])
    for key, parameter in signature.parameters.items():
        if parameter.default is inspect.Parameter.empty and key not in settings:
            raise BadInput(f"light '{kind}' needs the setting '{key}'.")
    environment = KINDS[kind](**settings)
    if scale == 1:
        return environment
    with np.errstate(over="ignore"):  # to infinity, which Environment refuses
        return replace(environment, radiance=environment.radiance * np.float32(scale))
