"""Studies of frequency space, and what Ramamoorthi and Hanrahan 2001 and 2002 show."""

from __future__ import annotations

from collections.abc import Callable

from envbench.records import Study


def _microfacet_orders() -> Study:
    """Least SHRM orders of the simplified microfacet beside table 5 of RH 2002."""
    from benchmarks.studies import orders

    return orders.microfacet_orders()


def _captured_energy() -> Study:
    """Energy of the simplified microfacet that F = 30 holds by P, beside what is known of it and a product rule."""
    from benchmarks.studies import orders

    return orders.captured_energy()


def _claimed_orders() -> Study:
    """What Lafortune's skin and Kajiya and Kay's hair lose at the orders that RH 2002 claims."""
    from benchmarks.studies import orders

    return orders.claimed_orders()


def _irradiance_9_terms() -> Study:
    """Errors of nine-term irradiance under the captured lights, beside Ramamoorthi and Hanrahan 2001."""
    from benchmarks.studies import irradiance

    return irradiance.nine_terms()


def _representations() -> Study:
    """Bytes, times, terms and errors of five representations of a light field, beside table 2 of RH 2002."""
    from benchmarks.studies import representations

    return representations.representations()


def _prefiltering_costs() -> Study:
    """Time of prefiltering against each size and order by itself, beside table 3 of RH 2002."""
    from benchmarks.studies import complexity

    return complexity.costs()


def _phong_prefiltering() -> Study:
    """Times of both domains for Phong lobes, beside table 4 of RH 2002."""
    from benchmarks.studies import prefiltering

    return prefiltering.phong_times()


def _prefiltering_crossover() -> Study:
    """Phong exponent at which both domains take equal time, beside S_L^(4/3)."""
    from benchmarks.studies import prefiltering

    return prefiltering.crossover()


def _facet_prefiltering() -> Study:
    """Orders and times of both domains for the simplified microfacet, beside table 5 of RH 2002."""
    from benchmarks.studies import prefiltering

    return prefiltering.facet_times()


def _accuracy_by_order() -> Study:
    """Accuracy of an order F approximation and its estimates under the Grace Cathedral: figure 6 of RH 2002."""
    from benchmarks.studies import accuracy

    return accuracy.grace()


def _accuracy_by_order_workshop() -> Study:
    """The same under a light that the project ships."""
    from benchmarks.studies import accuracy

    return accuracy.workshop()


def _curet_accuracy() -> Study:
    """Energy that F = 30 holds of each CUReT sample by P: figure 8 of RH 2002."""
    from benchmarks.studies import accuracy

    return accuracy.curet()


def _preset_accuracy() -> Study:
    """The same of the materials that need no data."""
    from benchmarks.studies import accuracy

    return accuracy.presets()


def _samples_per_order() -> Study:
    """Samples that explicit maps need for their orders, beside S ~ 10 F and T ~ 10 P."""
    from benchmarks.studies import sampling

    return sampling.samples_per_order()


def _radial_orders() -> Study:
    """Orders of Phong and Lambertian lobes beside the closed forms of RH 2002."""
    from benchmarks.studies import radial_orders

    return radial_orders.radial_orders()


def _shrm_frame_rate() -> Study:
    """Frames a second of the global SHRM at 64 x 64 x 6, beside sec. 7.5 of RH 2002."""
    from benchmarks.studies import frames

    return frames.frame_rate()


def _rh_figure_1() -> Study:
    """Five materials under four light probes on the armadillo, as figure 1 of RH 2002."""
    from benchmarks.studies import gallery

    return gallery.figure_1("rh-figure-1")


def _rh_figure_1_shipped() -> Study:
    """Five analytic materials under four lights that need no data, on a vase, for figure 1 of RH 2002."""
    from benchmarks.studies import gallery

    return gallery.figure_1("rh-figure-1-shipped", gallery.SHIPPED, gallery.ANALYTIC, "vase")


def _rh_figure_5() -> Study:
    """Light blur by BRDF blur under the Grace Cathedral: the lower frequency decides, as in figure 5 of RH 2002."""
    from benchmarks.studies import frequency_grid

    return frequency_grid.figure_5("rh-figure-5")


def _rh_figure_5_workshop() -> Study:
    """The grid of figure 5 of RH 2002 under the workshop."""
    from benchmarks.studies import frequency_grid

    return frequency_grid.figure_5("rh-figure-5-workshop", "workshop", "the workshop")


def _rh_figure_7() -> Study:
    """Images and errors by P under the Grace Cathedral, as figure 7 of RH 2002."""
    from benchmarks.studies import view_orders

    return view_orders.figure_7("rh-figure-7")


def _rh_figure_7_workshop() -> Study:
    """Images and errors by P, as figure 7 of RH 2002, under the workshop."""
    from benchmarks.studies import view_orders

    return view_orders.figure_7("rh-figure-7-workshop", "workshop", "the workshop")


def _rh_figure_9() -> Study:
    """SHRM and azimuthal averages on CUReT's velvet, as figure 9 of RH 2002."""
    from benchmarks.studies import rivals

    return rivals.figure_9("rh-figure-9")


def _rh_figure_9_felt() -> Study:
    """SHRM and azimuthal averages on Lafortune's felt, for figure 9 of RH 2002."""
    from benchmarks.studies import rivals

    return rivals.figure_9(
        "rh-figure-9-felt", "lafortune-felt", {"studio": "studio", "workshop": "workshop"}, "felt (Lafortune)"
    )


def _rh_figure_10() -> Study:
    """SHRM and Cabral's twelve maps on two hard materials, as figure 10 of RH 2002."""
    from benchmarks.studies import rivals

    return rivals.figure_10("rh-figure-10")


STUDIES: dict[str, Callable[[], Study]] = {
    "microfacet-orders": _microfacet_orders,
    "captured-energy": _captured_energy,
    "claimed-orders": _claimed_orders,
    "irradiance-9-terms": _irradiance_9_terms,
    "representations": _representations,
    "prefiltering-costs": _prefiltering_costs,
    "phong-prefiltering": _phong_prefiltering,
    "prefiltering-crossover": _prefiltering_crossover,
    "facet-prefiltering": _facet_prefiltering,
    "accuracy-by-order": _accuracy_by_order,
    "accuracy-by-order-workshop": _accuracy_by_order_workshop,
    "curet-accuracy": _curet_accuracy,
    "preset-accuracy": _preset_accuracy,
    "samples-per-order": _samples_per_order,
    "radial-orders": _radial_orders,
    "shrm-frame-rate": _shrm_frame_rate,
    "rh-figure-1": _rh_figure_1,
    "rh-figure-1-shipped": _rh_figure_1_shipped,
    "rh-figure-5": _rh_figure_5,
    "rh-figure-5-workshop": _rh_figure_5_workshop,
    "rh-figure-7": _rh_figure_7,
    "rh-figure-7-workshop": _rh_figure_7_workshop,
    "rh-figure-9": _rh_figure_9,
    "rh-figure-9-felt": _rh_figure_9_felt,
    "rh-figure-10": _rh_figure_10,
}
