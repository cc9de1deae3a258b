"""Times of prefiltering against each size and order by itself: RH 2002, table 3.

One thing is turned over a decade and more, all else stands still; the exponent of a power law is what the paper's
table of costs predicts. Maps of S x S texels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from benchmarks.studies.clock import fastest
from benchmarks.studies.prefiltering import EPS_ANGULAR, angular, by_sums, by_transforms, light
from data_gen.lobes import Microfacet, Phong
from envbench import harmonics
from envbench.material import Lobe
from envbench.records import Study
from methods.shrm import explicit, maps
from methods.shrm.coefficients import expand

SIZES = (32, 64, 128, 256, 320)
ORDERS = (8, 16, 32, 64, 96)
VIEW_ORDERS = (0, 1, 3, 6, 9)
VIEWS = (2, 4, 8, 16, 20)
LARGE = (64, 128, 256, 640)
"""Where transforms are so fast that a small map takes no longer than a call does."""
EXPONENTS = (8, 32, 128, 512)

Case = tuple[str, str, str, float, float]
"""Domain, BRDF, what is turned, its value, and the exponent that the paper predicts."""


def costs() -> Study:
    """Return the time of every case."""
    runs = dict(_cases())
    found = fastest(runs)
    return Study(
        "prefiltering-costs",
        "Time of prefiltering against each size and order by itself",
        f"Fastest of rounds in turns, {harmonics.threads()} threads, under the studio. Angular: the sum over the "
        "texels in the cone; frequency: ducc0's transforms, or the paper's own separable sums. P stands as P + 1, as "
        "appendix C says for its formulae. Predicted: the exponent in table 3.",
        ("domain", "BRDF", "turned", "value", "predicted", "seconds"),
        tuple((*case, seconds) for case, seconds in found.items()),
    )


def _cases() -> Iterator[tuple[Case, Callable[[], Any]]]:
    yield from _angular()
    yield from _radial()
    yield from _facets()


def _angular() -> Iterator[tuple[Case, Callable[[], Any]]]:
    wide, small = Phong(exponent=8.0, clipped=False), light(96)
    for size in SIZES:
        yield ("angular", "1D", "S_L", size, 2), angular(wide, light(size), (48, 48), EPS_ANGULAR)
        yield ("angular", "1D", "S_B", size, 2), angular(wide, small, (size, size), EPS_ANGULAR)
    for s in EXPONENTS:
        width = 0.5 * (1 - EPS_ANGULAR ** (1 / (s + 1)))  # app. D
        lobe = Phong(exponent=float(s), clipped=False)
        yield ("angular", "1D", "W", width, 1), angular(lobe, light(128), (128, 128), EPS_ANGULAR)
    for views in VIEWS:
        lobe = Microfacet(sigma=0.2, clipped=False)
        yield ("angular", "3D", "T", views, 2), angular(lobe, light(48), (24, 24), EPS_ANGULAR, views)


def _radial() -> Iterator[tuple[Case, Callable[[], Any]]]:
    fine = light(256)
    for way, run in (("frequency", by_transforms), ("frequency, the paper's sums", by_sums)):
        for order in ORDERS:
            kept = expand(Phong(exponent=64.0, clipped=False), 0.01, order, 0)
            yield (way, "1D", "F", order, 1), run(kept, fine, (256, 256))
        kept = expand(Phong(exponent=32.0, clipped=False), 0.01, 14, 0)
        for size in (128, 256, 640, 1280):
            yield (way, "1D", "S", size, 2), run(kept, light(size), (size, size))


def _facets() -> Iterator[tuple[Case, Callable[[], Any]]]:
    lobe: Lobe = Microfacet(sigma=0.2, clipped=False)
    radiance = light(128)

    def synthesis(order: int, view_order: int, size: int) -> Callable[[], Any]:
        kept = expand(lobe, 0.03, order, view_order)
        seen = harmonics.analyse(radiance, order)
        return lambda: maps.synthesise(kept, seen, size, size)

    for order in (4, *ORDERS[:-1]):
        if order < 64:
            yield ("frequency", "SHRM", "F", order, 1), synthesis(order, 2, 128)
    for view_order in VIEW_ORDERS:
        yield ("frequency", "SHRM", "P + 1", view_order + 1, 2), synthesis(16, view_order, 96)
    for size in LARGE:
        yield ("frequency", "SHRM", "S_B", size, 2), synthesis(12, 2, size)

    def table(view_order: int, views: int, size: int) -> Callable[[], Any]:
        kept = expand(lobe, 0.03, 12, view_order)
        planes = maps.synthesise(kept, harmonics.analyse(radiance, 12), size, size)
        return lambda: explicit.views(kept, planes, views)

    for views in (4, 8, 16, 40):
        yield ("frequency", "3D", "T", views, 2), table(2, views, 32)
    for view_order in VIEW_ORDERS:
        yield ("frequency", "3D", "P + 1", view_order + 1, 1), table(view_order, 10, 48)
    for size in LARGE:
        yield ("frequency", "3D", "S_B", size, 2), table(2, 2, size)
