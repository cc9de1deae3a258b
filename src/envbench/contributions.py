"""The command ``envbench effects``: what each effect contributes to a scene, as a table and a strip of images."""

from __future__ import annotations

import math
from pathlib import Path

from envbench import llvm, root
from envbench.effects import EffectSettings
from envbench.errors import BadInput, unknown
from envbench.grids import KINDS
from envbench.reference import ReferenceSettings
from envbench.scene import Decision, Scene
from envbench.show import console


def show(name: str, settings: EffectSettings, reference: ReferenceSettings, out: Path, user: Path | None) -> None:
    """Print the table of a scene's effects, and write the strip of images into `out` where its view is an image.

    Parameters
    ----------
    name : str
        light/material/geometry/view, names of presets.

    Raises
    ------
    BadInput
        The name has not four parts, or one of them is unknown or cannot be used; `out` cannot be written.
    CannotRun
        The variant cannot run on this machine.
    """
    catalogue = root.load(user).catalogue
    names = name.split("/")
    if len(names) != len(KINDS):
        raise BadInput(f"a scene is light/material/geometry/view, four names of presets. Got '{name}' instead.")
    specs = {}
    for (kind, presets), part in zip(KINDS.items(), names, strict=True):
        known = getattr(catalogue, presets)
        if part not in known:
            raise unknown(kind, part, known)
        specs[kind] = known[part]
    llvm.mitsuba(reference.variant)
    scene = catalogue.scene(name=name, **specs)
    planned, picture = catalogue.contributions(scene, settings, reference)
    _table(planned, settings)
    if picture is None:
        console().print("no images: the view's points form none.")
        return
    path = out / f"effects-{name.replace('/', '-')}.png"
    try:
        out.mkdir(parents=True, exist_ok=True)
        path.write_bytes(picture)
    except OSError as error:
        raise BadInput(f"cannot write the images to '{path}': {error.strerror}. Name a writable folder.") from None
    console().print(f"images: {path}")


def _table(scene: Scene, settings: EffectSettings) -> None:
    from rich.table import Table

    headings = "effect", "called for?", "by", "contribution", "98 % interval", "cost", "saved", "why"
    grid = Table(*headings, box=None, header_style="bold")
    for d in scene.decisions:
        answer = "yes" if d.simulated else "no"
        more = f" ({d.bounces} bounces)" if d.bounces else ""
        grid.add_row(d.effect, answer + more, d.basis, *_numbers(d), d.reason)
    console().print(f"{scene.name}: tolerance {settings.limit:.3g} of the RMS radiance")
    console().print(grid)
    spent = sum(d.seconds for d in scene.decisions)
    console().print(f"Probes took {_seconds(spent)}. Cost and savings: of the reference, by the probes' time a sample.")


def _numbers(d: Decision) -> tuple[str, str, str, str]:
    if math.isnan(d.contribution):
        return "", "", "", ""
    if not d.high:
        return "none", "", "", ""
    seconds = (_seconds(d.cost) if not math.isnan(d.cost) else "", _seconds(d.saved) if d.saved else "")
    return f"{d.contribution:.2%}", f"{d.low:.2%} to {d.high:.2%}", *seconds


def _seconds(value: float) -> str:
    return f"{value:.0f} s" if value >= 10 else f"{value:.2g} s"
