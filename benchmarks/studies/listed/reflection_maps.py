"""Studies of reflection maps, and what Cabral, Olano and Nemec 1999 show."""

from __future__ import annotations

from collections.abc import Callable

from envbench.records import Study


def _cabral_figure_3() -> Study:
    """Layered paint on a mesh from twelve maps beside the reference, as figure 3 of Cabral et al. 1999."""
    from benchmarks.studies import layered_paint

    return layered_paint.figure_3("cabral-figure-3")


def _cabral_figure_3_vase() -> Study:
    """Layered paint on a vase, for figure 3 of Cabral et al. 1999."""
    from benchmarks.studies import layered_paint

    return layered_paint.figure_3("cabral-figure-3-vase", "vase")


def _cabral_figure_4() -> Study:
    """Source maps, warped, weighted and blended, as figure 4 of Cabral et al. 1999."""
    from benchmarks.studies import reflection_space

    return reflection_space.figure_4("cabral-figure-4")


def _cabral_figure_5() -> Study:
    """All maps behind a painted car, as figure 5 of Cabral et al. 1999."""
    from benchmarks.studies import layered_paint

    return layered_paint.figure_5("cabral-figure-5")


def _cabral_number_of_maps() -> Study:
    """Error of 12, 42 and 162 maps on several materials (Cabral et al. 1999, section 3.1)."""
    from benchmarks.studies import reflection_space

    return reflection_space.number_of_maps("cabral-number-of-maps")


def _cabral_costs() -> Study:
    """What a source map and a frame cost (Cabral et al. 1999, section 5)."""
    from benchmarks.studies import layered_paint

    return layered_paint.costs("cabral-costs")


STUDIES: dict[str, Callable[[], Study]] = {
    "cabral-figure-3": _cabral_figure_3,
    "cabral-figure-3-vase": _cabral_figure_3_vase,
    "cabral-figure-4": _cabral_figure_4,
    "cabral-figure-5": _cabral_figure_5,
    "cabral-number-of-maps": _cabral_number_of_maps,
    "cabral-costs": _cabral_costs,
}
