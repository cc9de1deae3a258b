"""Studies by name: tables that belong to no scene and method. A suite asks for them by ``studies = [...]``.

A study is a function without arguments that returns an `envbench.records.Study`. It is registered here by a function
of its own, whose docstring is what `envbench list studies` prints, and which imports only when it is called.
"""

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


def _zonal_random_vectors() -> Study:
    """Error of random SH vectors as sums of zonal lobes, beside figure 2 of Sloan, Luna and Snyder 2005."""
    from benchmarks.studies import zonal_fits

    return zonal_fits.random_vectors()


def _zonal_head() -> Study:
    """Error and time of the zonal fit of a head's transfer, beside figure 3 and SciPy's BFGS."""
    from benchmarks.studies import zonal_fits

    return zonal_fits.head_fit()


def _glossy_head() -> Study:
    """Errors of glossy transfer on a head by rows and lobes, beside figure 4."""
    from benchmarks.studies import zonal_fits

    return zonal_fits.glossy_head()


def _transfer_agreement() -> Study:
    """Simulated transfer against Mitsuba's rendering under band-limited lights."""
    from benchmarks.studies import error_budget

    return error_budget.transfer_agreement()


def _error_budget() -> Study:
    """Each cause of LDPRT's error on a bent head by itself, and all together against the whole."""
    from benchmarks.studies import error_budget

    return error_budget.error_budget()


def _sh_rotation() -> Study:
    """Products and exactness of SH rotation by zxzxz, beside the printed table."""
    from benchmarks.studies import turning

    return turning.sh_rotation()


def _thin_membrane() -> Study:
    """The thin membrane's coefficients against their integral."""
    from benchmarks.studies import turning

    return turning.thin_membrane()


def _shading() -> Study:
    """Times and errors of each way to shade a deforming head's points."""
    from benchmarks.studies import turning

    return turning.shading()


def _effects_known() -> Study:
    """Effects planned on scenes of known answer: which, and what leaving out the others saves."""
    from benchmarks.studies import effect_plans

    return effect_plans.effects_known()


def _effects_random() -> Study:
    """Decisions about effects on random scenes: how many are wrong, how many needless, what they save."""
    from benchmarks.studies import effect_trials

    return effect_trials.effects_random()


def _wrinkle_map() -> Study:
    """Errors of the wrinkle's map of lobes at its nodes and between them, beside nodes fitted one by one."""
    from benchmarks.studies import wrinkles

    return wrinkles.wrinkle_map()


def _cylinder_wrinkle() -> Study:
    """A cylinder with wrinkles, shaded by the map, against Mitsuba; beside figure 6 of Sloan, Luna and Snyder 2005."""
    from benchmarks.studies import wrinkles

    return wrinkles.cylinder_wrinkle()


def _varying_light() -> Study:
    """Errors and rates where the light differs over the shape, by tables of the harmonics."""
    from benchmarks.studies import varying_light

    return varying_light.varying_light()


def _deformed_patch() -> Study:
    """Texture patches in a pose, by LDPRT and its rivals, against Mitsuba; beside figure 5."""
    from benchmarks.studies import deformed

    return deformed.deformed_patch()


def _deformed_head() -> Study:
    """The head bent and twisted: ray traced, with undeformed transfer, by LDPRT; beside figure 6."""
    from benchmarks.studies import deformed

    return deformed.deformed_head()


def _deformed_vase() -> Study:
    """What deformed-head shows, of a generated vase: where the head is absent."""
    from benchmarks.studies import deformed

    return deformed.deformed_head(stand_in=True)


def _textured_vase() -> Study:
    """Textures laid onto a vase that bends, one of them glossy; beside figure 7."""
    from benchmarks.studies import deformed

    return deformed.textured_vase()


def _flying_bat() -> Study:
    """The bat as a thin membrane of one lobe, in its wing beat; beside figure 1."""
    from benchmarks.studies import deformed

    return deformed.flying_bat()


def _waving_membrane() -> Study:
    """What flying-bat shows, of a generated sheet: where the bat is absent."""
    from benchmarks.studies import deformed

    return deformed.flying_bat(stand_in=True)


def _zonal_patch() -> Study:
    """What zonal-head shows, of a generated patch: where the head is absent."""
    from benchmarks.studies import zonal_fits
    from benchmarks.studies.stand_ins import RELIEF

    return zonal_fits.head_fit(RELIEF)


def _glossy_patch() -> Study:
    """What glossy-head shows, of a generated patch: where the head is absent."""
    from benchmarks.studies import zonal_fits
    from benchmarks.studies.stand_ins import RELIEF

    return zonal_fits.glossy_head(RELIEF)


def _ldprt_timings() -> Study:
    """Times of simulation, fits, shading and the light's table, beside section 6 of Sloan 2005."""
    from benchmarks.studies import ldprt_timings

    return ldprt_timings.timings()


def _ldprt_timings_generated() -> Study:
    """What ldprt-timings shows, of generated shapes: where the meshes are absent."""
    from benchmarks.studies import ldprt_timings
    from benchmarks.studies.stand_ins import RELIEF, SHEET

    return ldprt_timings.timings(RELIEF, SHEET)


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
    "microfacet-orders": _microfacet_orders,
    "captured-energy": _captured_energy,
    "claimed-orders": _claimed_orders,
    "zonal-random-vectors": _zonal_random_vectors,
    "zonal-head": _zonal_head,
    "glossy-head": _glossy_head,
    "transfer-agreement": _transfer_agreement,
    "sh-rotation": _sh_rotation,
    "thin-membrane": _thin_membrane,
    "shading": _shading,
    "error-budget": _error_budget,
    "effects-known": _effects_known,
    "effects-random": _effects_random,
    "wrinkle-map": _wrinkle_map,
    "cylinder-wrinkle": _cylinder_wrinkle,
    "varying-light": _varying_light,
    "deformed-patch": _deformed_patch,
    "deformed-head": _deformed_head,
    "deformed-vase": _deformed_vase,
    "textured-vase": _textured_vase,
    "flying-bat": _flying_bat,
    "waving-membrane": _waving_membrane,
    "zonal-patch": _zonal_patch,
    "glossy-patch": _glossy_patch,
    "ldprt-timings": _ldprt_timings,
    "ldprt-timings-generated": _ldprt_timings_generated,
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
    "cabral-figure-3": _cabral_figure_3,
    "cabral-figure-3-vase": _cabral_figure_3_vase,
    "cabral-figure-4": _cabral_figure_4,
    "cabral-figure-5": _cabral_figure_5,
    "cabral-number-of-maps": _cabral_number_of_maps,
    "cabral-costs": _cabral_costs,
}
