"""Measured materials: each is its table (`data_gen.measured.table`), which references and methods alike evaluate.

`KINDS` make a material of a suite's table, `PRESETS` are such tables; their files are looked for when one is built.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from data_gen.external import locate
from data_gen.measured import cornell, curet, merl, nbrdf, rgl
from data_gen.measured.table import Table
from data_gen.measured.tabulated import Tabulated
from data_gen.measured.tabulation import TOLERANCE, Fidelity
from envbench.errors import BadInput, unknown
from envbench.material import Material

__all__ = ["KINDS", "PRESETS", "Tabulated"]

_FOLDER = "brdfs"
_NBRDF = f"{_FOLDER}/nbrdf/weights.npz"
_CURET = f"{_FOLDER}/curet"
"""Where the files of these kinds are looked for unless ``path`` says otherwise."""

Made = tuple[Table, tuple[str, ...]]


def _merl(path: Path) -> Made:
    table, fidelity, cells = merl.table(path)
    notes = [f"{cells.holes:.1%} of the cells above the horizon are not measured, filled from smaller theta_d"]
    if cells.changed:
        notes.append(f"{path.name} has a published file's name, but not its contents (sha256 differs)")
    return table, (*(notes if cells.holes or cells.changed else ()), *_fidelity(fidelity))


def _rgl(path: Path) -> Made:
    table, fidelity = rgl.table(path)
    return table, _fidelity(fidelity)


def _cornell(path: Path) -> Made:
    table, fidelity, scattered = cornell.table(path)
    own = (
        "31 wavelengths to linear sRGB under D65 (CIE 1931); scattered samples are interpolated as pbrt-v2 does, and"
        " jump where it does; peaks narrower than about 8 degrees are blurred, retro-reflection is not measured",
        f"{scattered.zeros:.1%} of the spectral values are exactly 0, lost in noise",
    )
    return table, (*own, *_fidelity(fidelity))


def _curet(path: Path, sample: int | str) -> Made:
    table, fidelity, fit = curet.table(path, sample)
    own = (
        f"fit of order 8 to {curet.GEOMETRIES - fit.masked} measurements, the mean of r, g and b: residual"
        f" {fit.residual:.1%} RMS, {fit.left_out:.1%} for a measurement left out; condition {fit.condition:.0f},"
        f" ridge {fit.ridge:g}",
        *([f"{fit.masked} measurements of 0 or less are left out"] if fit.masked else []),
    )
    return table, (*own, *_fidelity(fidelity))


def _nbrdf(path: Path, material: str) -> Made:
    table, fidelity = nbrdf.table(path, material)
    return table, _fidelity(fidelity)


def _fidelity(fidelity: Fidelity) -> tuple[str, ...]:
    lines: list[str] = []
    if fidelity.asymmetry > 0.001:
        lines.append(f"taking the mean with its mirror image changed it by {fidelity.asymmetry:.1%} RMS")
    if fidelity.negative > 0:
        lines.append(
            f"negative in some channel at {fidelity.negative:.2%} of the directions, clamped to 0: {fidelity.lost:.3%}"
            " of its energy"
        )
    if fidelity.error > TOLERANCE:
        lines.append(f"the table differs from its source by {fidelity.error:.1%} RMS")
    return tuple(lines)


def _kind(build: Callable[..., Made], where: str | None = None, choice: str | None = None) -> Any:
    """Return what makes a material of a table with ``path``, by default `where`, and what chooses within the file."""

    def material(spec: Mapping[str, Any], name: str) -> Material:
        known = ["path"] + ([choice] if choice else [])
        for key in spec:
            if key not in ("kind", *known):
                raise unknown(f"setting of material '{name}':", str(key), known)
        path, chosen = spec.get("path", where), spec.get(choice) if choice else None
        if not isinstance(path, str | Path) or not str(path):
            raise BadInput(f"material '{name}': path must name a file. Got {path!r} instead.")
        if choice and (not isinstance(chosen, int | str) or isinstance(chosen, bool)):
            raise BadInput(f"material '{name}': {choice} must say which one of the file. Got {chosen!r} instead.")
        found = locate(path)
        table, told = _made(build, found, _stamp(found), *(() if chosen is None else (chosen,)))
        return Material(name, (Tabulated(table=table),), None, told)

    return material


@lru_cache(maxsize=16)
def _made(build: Callable[..., Made], path: Path, stamp: tuple[int, ...], *chosen: int | str) -> Made:
    return build(path, *chosen)


def _stamp(path: Path) -> tuple[int, ...]:
    files: Iterable[Path] = sorted(path.iterdir()) if path.is_dir() else (path,)
    return tuple(number for file in files for number in (file.stat().st_mtime_ns, file.stat().st_size))


KINDS: dict[str, Callable[[Mapping[str, Any], str], Material]] = {
    "merl": _kind(_merl),
    "rgl": _kind(_rgl),
    "cornell": _kind(_cornell),
    "curet": _kind(_curet, _CURET, "sample"),
    "nbrdf": _kind(_nbrdf, _NBRDF, "material"),
}
"""Tables: ``{"kind": "merl" | "rgl" | "cornell", "path": ...}``, ``{"kind": "curet", "sample": number or name}``,
``{"kind": "nbrdf", "material": name}``; the last two with an optional ``path``."""

_RGL_NAMES = ("paper_white", "satin_rosaline", "cg_sunflower", "colodur_napoli_4f", "cc_ibiza_sunset")
_CORNELL_NAMES = ("acryl_blue", "cayman", "garnet_red", "krylon_blue", "mystique")
_NBRDF_NAMES = (
    "alum-bronze", "aluminium", "black-fabric", "blue-metallic-paint", "brass", "chrome", "dark-red-paint",
    "gold-metallic-paint", "gray-plastic", "green-latex", "nickel", "pearl-paint", "pink-felt",
    "silver-metallic-paint", "specular-black-phenolic", "specular-red-phenolic", "steel", "teflon", "white-fabric",
    "yellow-matte-plastic",
)  # fmt: skip

PRESETS: dict[str, dict[str, Any]] = {
    **{
        f"rgl-{name.replace('_', '-')}": {"kind": "rgl", "path": f"{_FOLDER}/rgl/{name}_rgb.bsdf"}
        for name in _RGL_NAMES
    },
    **{
        name.replace("_", "-"): {"kind": "cornell", "path": f"{_FOLDER}/cornell/{name}.brdf"} for name in _CORNELL_NAMES
    },
    **{
        f"curet-{number:02}-{name.replace(' ', '-')}": {"kind": "curet", "sample": number}
        for number, name in enumerate(curet.NAMES, 1)
    },
    **{f"nbrdf-{name}": {"kind": "nbrdf", "material": name} for name in _NBRDF_NAMES},
}
"""Materials of the data folder."""
