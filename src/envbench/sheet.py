"""A material by itself on the terminal: facts, warnings, orders, albedo, and its lobes drawn in characters."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from envbench.catalogue import Spec
from envbench.errors import BadInput, unknown
from envbench.records import MaterialSheet
from envbench.settings import plain

if TYPE_CHECKING:
    from rich.console import Console

REACH = 3.0
"""Lobes are drawn with the radius (value / largest)^(1/3): a peak a thousand times its skirt leaves that a tenth."""


def missing(name: str, spec: Spec, reason: str) -> MaterialSheet:
    """Return the sheet of a material of which nothing could be found out, with the reason as its note."""
    nothing = math.nan
    return MaterialSheet(name, plain(spec), (), (reason,), nothing, nothing, (), (), (), ())


def show(name: str, materials: Mapping[str, Spec], make: Any, plot: Path | None, console: Console) -> None:
    """Print a material's sheet, and write its lobe plot as HTML if asked.

    Raises
    ------
    BadInput
        The material is unknown or cannot be read, or the plot cannot be written.
    """
    if name not in materials:
        raise unknown("material", name, materials)
    sheet: MaterialSheet = make(name, materials[name])
    _facts(sheet, console)
    _orders(sheet, console)
    _albedo(sheet, console)
    _lobes(sheet, console)
    if plot is not None:
        write_plot(sheet, plot)
        console.print(f"lobe plot: {plot}")


def energy(sheet: MaterialSheet, order: int) -> float:
    """Return the energy captured at P = `order`, F = 30, of the lobe that loses most; NaN where it is not known."""
    last: dict[int, float] = {}
    for lobe, p, value in sorted(sheet.captured):
        if p <= order:
            last[lobe] = value  # a radially symmetric lobe ends at P = 0
    return min(last.values(), default=math.nan)


def worst_albedo(sheet: MaterialSheet) -> tuple[float, float]:
    """Return the largest directional albedo over r, g and b, and the view's angle in degrees where it is."""
    return max(((max(rgb), degrees) for degrees, *rgb in sheet.albedo), default=(math.nan, math.nan))


def _facts(sheet: MaterialSheet, console: Console) -> None:
    console.print(sheet.name, style="bold")
    for lobe in sheet.lobes:
        console.print(f"  {lobe}")
    albedo, at = worst_albedo(sheet)
    console.print(f"  reciprocity  rho(L, V) and rho(V, L) differ by {sheet.reciprocity:.2%} (RMS over RMS)")
    console.print(f"  negative     {sheet.negative:.2%} of pairs before clamping")
    console.print(f"  energy       directional albedo at most {albedo:.4f}, at {at:g} degrees")
    for note in sheet.notes:
        console.print(f"  warning: {note}", style="yellow")


def _orders(sheet: MaterialSheet, console: Console) -> None:
    from rich.table import Table

    console.print("\nSHRM orders (F, P) that leave out at most eps of a lobe's energy", style="bold")
    grid = Table("lobe", "eps", "F", "P", "left out", box=None, header_style="dim")
    for eps, lobe, order, view_order, lost in sheet.orders:
        short = "" if lost <= eps else "  not reached"
        grid.add_row(str(lobe + 1), f"{eps:g}", str(order), str(view_order), f"{lost:.2g}{short}")
    console.print(grid)
    orders = sorted({p for _, p, _ in sheet.captured})
    console.print("\nenergy captured at F = 30", style="bold")
    grid = Table("lobe", *(f"P = {p}" for p in orders), box=None, header_style="dim")
    for lobe in sorted({lobe for lobe, _, _ in sheet.captured}):
        known = {p: value for number, p, value in sheet.captured if number == lobe}
        grid.add_row(str(lobe + 1), *(f"{known[p]:.4f}" if p in known else "" for p in orders))
    console.print(grid)


def _albedo(sheet: MaterialSheet, console: Console) -> None:
    from rich.table import Table

    console.print("\ndirectional albedo by the view's angle to the normal", style="bold")
    grid = Table("", *(f"{degrees:g} deg" for degrees, *_ in sheet.albedo), box=None, header_style="dim")
    for channel, name in enumerate("rgb", 1):
        grid.add_row(name, *(f"{row[channel]:.4f}" for row in sheet.albedo))
    console.print(grid)


def _lobes(sheet: MaterialSheet, console: Console) -> None:
    from rich.columns import Columns

    if not sheet.slices:
        return
    console.print("\nlobes in the plane of incidence, light from the left; radius: cube root of rho cos", style="bold")
    console.print(Columns([f"{_drawn(angles, values, light)}\n light at {light:g} deg, peak {max(values):.3g} / sr"
                           for light, angles, values in sheet.slices], padding=(1, 3)))  # fmt: skip


def radii(values: Sequence[float]) -> list[float]:
    """Return the radii at which values are drawn, the largest 1."""
    high = max((value for value in values if math.isfinite(value)), default=0.0)
    return [(max(value, 0.0) / high) ** (1 / REACH) if high > 0 and math.isfinite(value) else 0.0 for value in values]


def _drawn(angles: Sequence[float], values: Sequence[float], light: float) -> str:
    """Draw the upper half plane: the lobe, the ground, and a ray towards the light."""
    from envbench.braille import Canvas

    width, height = 64, 34
    canvas = Canvas(width, height)
    middle, ground, unit = width // 2, height - 3, height - 4

    def place(angle: float, radius: float) -> tuple[float, float]:
        turn = math.radians(angle)
        return middle + unit * radius * math.sin(turn), ground - unit * radius * math.cos(turn)

    outline = [place(angle, radius) for angle, radius in zip(angles, radii(values), strict=True)]
    for start, end in itertools.pairwise(outline):
        canvas.line(start, end)
    canvas.line((1, ground + 1), (width - 2, ground + 1))
    for step in range(0, 10, 3):  # dashes: the light
        canvas.line(place(-light, 0.1 * step), place(-light, 0.1 * step + 0.12))
    return str(canvas)


def write_plot(sheet: MaterialSheet, path: Path) -> None:
    """Write the lobe plot as one HTML file that opens offline; raises `BadInput` if that fails."""
    import plotly.graph_objects as go

    figure = go.Figure(
        [
            go.Scatterpolar(theta=angles, r=values, name=f"light at {light:g} deg", mode="lines")
            for light, angles, values in sheet.slices
        ]
    )
    figure.update_layout(
        title=f"{sheet.name}: rho cos in 1/sr, mean of r, g and b, in the plane of incidence; light from the left",
        polar={
            "sector": [0, 180],
            "angularaxis": {"rotation": 90, "direction": "clockwise", "tickvals": list(range(-90, 91, 15))},
        },
        updatemenus=[
            {
                "type": "buttons",
                "direction": "right",
                "x": 0.6,
                "y": 0,
                "buttons": [
                    {"label": f"{kind} radius", "method": "relayout", "args": [{"polar.radialaxis.type": kind}]}
                    for kind in ("linear", "log")
                ],
            }
        ],
    )
    try:
        figure.write_html(path, include_plotlyjs=True)
    except OSError as error:
        raise BadInput(f"cannot write the plot to '{path}': {error.strerror}. Name a writable file.") from None
