"""Materials by themselves: a sortable table of orders, energy and reciprocity, and a lobe plot of each on demand."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Sequence
from dataclasses import dataclass

from envbench.records import MaterialSheet
from envbench.sheet import energy, radii, worst_albedo
from reports.numerals import percent
from reports.table import Entry

PAPER_ABOVE, PAPER_SAMPLES = 56, 61
PAPER_WORST = ("9-frosted glass", "23-lettuce leaf", "33-slate a", "41-brick b", "57-peacock feather")
"""RH 2002, sec. 7.2 and fig. 8: CUReT samples of which F = 30, P = 5 holds more than 90 %, and the five others."""
ENOUGH = 0.9
VIEW_ORDER = 5
_SIZE = 150


@dataclass(frozen=True)
class MaterialRow:
    """A material: its entries (see `HEADINGS`), its lobes in words, notes, and lobe plot (SVG)."""

    name: str
    lobes: tuple[str, ...]
    notes: tuple[str, ...]
    entries: tuple[Entry, ...]
    plot: str


@dataclass(frozen=True)
class Curet:
    """The survey of CUReT: samples above `ENOUGH` of how many, and the worst five with what they hold."""

    above: int
    samples: int
    worst: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Materials:
    """What is shown; `absent` names by reason what no sheet could be made of."""

    headings: tuple[tuple[str, str], ...]
    rows: tuple[MaterialRow, ...]
    absent: dict[str, tuple[str, ...]]
    curet: Curet | None


def materials(sheets: Sequence[MaterialSheet]) -> Materials | None:
    """Return the section of a run's sheets, or None where it has none."""
    if not sheets:
        return None
    made = [sheet for sheet in sheets if sheet.lobes]
    absent: dict[str, tuple[str, ...]] = {}
    for sheet in sheets:
        if not sheet.lobes:
            reason = sheet.notes[0] if sheet.notes else "no reason was recorded"
            absent[reason] = (*absent.get(reason, ()), sheet.name)
    levels = sorted({eps for sheet in made for eps, *_ in sheet.orders}, reverse=True)
    headings = (
        *((f"F, P at {eps:g}", f"least orders that leave out at most {eps:g} of a lobe's energy") for eps in levels),
        (f"captured, P = {VIEW_ORDER}", f"energy held by F = 30, P = {VIEW_ORDER}; the lobe that loses most"),
        ("not reciprocal", "RMS of rho(L, V) - rho(V, L) over the RMS of rho, the cosine left out"),
        ("largest albedo", "directional albedo, the largest over views and channels; above 1 it gains energy"),
        ("negative", "share of directions at which some channel was negative before clamping"),
    )
    return Materials(headings, tuple(_row(sheet, levels) for sheet in made), absent, _curet(made))


def _row(sheet: MaterialSheet, levels: Sequence[float]) -> MaterialRow:
    held, (albedo, at) = energy(sheet, VIEW_ORDER), worst_albedo(sheet)
    entries = (
        *(_orders(sheet, eps) for eps in levels),
        Entry("–" if math.isnan(held) else f"{held:.4f}", order=_known(held), kind="low" if held < ENOUGH else ""),
        Entry(percent(sheet.reciprocity), order=_known(sheet.reciprocity)),
        Entry(f"{albedo:.3f}", f"at {at:g}°", _known(albedo), kind="low" if albedo > 1.001 else ""),
        Entry(percent(sheet.negative), order=_known(sheet.negative)),
    )
    return MaterialRow(sheet.name, sheet.lobes, sheet.notes, entries, _plot(sheet))


def _orders(sheet: MaterialSheet, eps: float) -> Entry:
    """Word F and P of each lobe; sorted by the number of coefficients."""
    found = [(F, P, lost) for level, _, F, P, lost in sheet.orders if level == eps]
    short = [f"lobe {i + 1} leaves out {lost:.2g}" for i, (_, _, lost) in enumerate(found) if lost > eps]
    text = " + ".join(f"{F}, {P}" for F, P, _ in found) or "–"
    return Entry(text, "; ".join(short), max(((F + 1) * (P + 1) for F, P, _ in found), default=None))


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _curet(sheets: Sequence[MaterialSheet]) -> Curet | None:
    known = {sheet.name: energy(sheet, VIEW_ORDER) for sheet in sheets if fnmatch.fnmatch(sheet.name, "curet-*")}
    if not known:
        return None
    worst = sorted(known.items(), key=lambda item: item[1])[:5]
    return Curet(sum(value > ENOUGH for value in known.values()), len(known), tuple(worst))


def _plot(sheet: MaterialSheet) -> str:
    """Draw the lobe in the plane of incidence, a small picture for each angle of the light."""
    return "".join(
        f"<figure>{_lobe(light, angles, values)}"
        f"<figcaption>light at {light:g}°, peak {max(values):.3g}/sr</figcaption></figure>"
        for light, angles, values in sheet.slices
    )


def _lobe(light: float, angles: Sequence[float], values: Sequence[float]) -> str:
    middle, ground, unit = _SIZE / 2, _SIZE / 2 - 4, _SIZE / 2 - 8

    def place(angle: float, radius: float) -> str:
        turn = math.radians(angle)
        return f"{middle + unit * radius * math.sin(turn):.1f},{ground - unit * radius * math.cos(turn):.1f}"

    outline = " ".join(place(angle, radius) for angle, radius in zip(angles, radii(values), strict=True))
    return (
        f'<svg class="lobe" viewBox="0 0 {_SIZE} {_SIZE // 2}" role="img" aria-label="lobe">'
        f'<path class="grid" d="M0 {ground}H{_SIZE}"/>'
        f'<polyline class="light" points="{place(-light, 0)} {place(-light, 1)}"/>'
        f'<polygon points="{place(0, 0)} {outline}"/></svg>'
    )
