"""Studies of precomputed transfer, and what Sloan, Luna and Snyder 2005 show."""

from __future__ import annotations

from collections.abc import Callable

from envbench.records import Study


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


def _error_budget() -> Study:
    """Each cause of LDPRT's error on a bent head by itself, and all together against the whole."""
    from benchmarks.studies import error_budget

    return error_budget.error_budget()


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


STUDIES: dict[str, Callable[[], Study]] = {
    "zonal-random-vectors": _zonal_random_vectors,
    "zonal-head": _zonal_head,
    "glossy-head": _glossy_head,
    "transfer-agreement": _transfer_agreement,
    "sh-rotation": _sh_rotation,
    "thin-membrane": _thin_membrane,
    "shading": _shading,
    "error-budget": _error_budget,
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
}
