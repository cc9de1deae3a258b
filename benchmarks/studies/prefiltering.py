"""Times of prefiltering in the angular and in the frequency domain: RH 2002, tables 4 and 5, and where they cross.

Light and maps have S x S texels in theta and phi, as in the paper. The angular domain is `methods.angular.prefilter`,
whose sum is culled to the lobe's cone; the frequency domain is that of `methods.shrm`, by ducc0's transforms, and
beside it the paper's own sums (`benchmarks.studies.separable`). All use the same threads. A change of light is timed:
the lobe's own coefficients stand in a column of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.clock import fastest
from benchmarks.studies.separable import Separable
from data_gen import environments
from data_gen.lobes import Microfacet, Phong
from envbench import harmonics, latlong
from envbench.material import Lobe
from envbench.records import Study
from envbench.timing import timed
from methods.angular.prefilter import prefilter
from methods.shrm import explicit, maps
from methods.shrm.coefficients import LobeCoefficients, expand

EXPONENTS = (8, 16, 32, 64, 128, 256, 512)
SIZE = 128
SQUARE = SIZE, SIZE
EPS_ANGULAR, EPS = 0.05, 0.01
SIGMAS = (0.1, 0.2, 0.3, 0.4, 0.5)
EPS_FACETS, VIEWS, FEW_VIEWS = 0.03, 10, 2
CROSSINGS = (64, 128, 256)
"""S_L of the crossover, on maps of S x 2 S texels: with fewer columns its F would be beyond what S = 64 holds."""


def light(rows: int, columns: int | None = None) -> NDArray[np.float32]:
    """Return the studio, (rows, columns, 3); square unless said otherwise."""
    columns = columns or rows
    fine = environments.build({"kind": "captured", "name": "studio", "size": rows}).radiance
    if len(fine) < rows:
        return latlong.interpolate(fine, latlong.grid(rows, columns)).astype(np.float32)
    return fine.reshape(rows, columns, -1, 3).mean(2).astype(np.float32)


def order(exponent: float) -> int:
    """Return F = 1 + sqrt(6 s), which leaves out less than eps = .01 (sec. 7.4)."""
    return ceil(1 + sqrt(6 * exponent))


Shape = tuple[int, int]


def by_transforms(lobe: LobeCoefficients, radiance: NDArray[np.float32], shape: Shape) -> Callable[[], Any]:
    """Return the frequency domain's work on a change of light: analysis, products, synthesis."""
    return lambda: maps.synthesise(lobe, harmonics.analyse(radiance, lobe.F), *shape)


def by_sums(lobe: LobeCoefficients, radiance: NDArray[np.float32], shape: Shape) -> Callable[[], Any]:
    """Return the same by the paper's sums, for a radially symmetric lobe."""
    analysis, synthesis = Separable.of(lobe.F, *radiance.shape[:2]), Separable.of(lobe.F, *shape)
    rho = lobe.rho[0, :, 0, 0].astype(np.float32)[None, :, None]
    return lambda: synthesis.synthesise(analysis.analyse(radiance) * rho)


def angular(lobe: Lobe, radiance: NDArray[np.float32], shape: Shape, eps: float, views: int = 1) -> Callable[[], Any]:
    """Return the angular domain's work."""
    return lambda: prefilter(radiance, lobe, shape, eps, views)


def phong_times() -> Study:
    """Return the times of both domains by the exponent."""
    radiance, runs = light(SIZE), {}
    lobes = {s: Phong(exponent=float(s), clipped=False) for s in EXPONENTS}
    for s, lobe in lobes.items():
        kept = expand(lobe, EPS, order(s), 0)
        runs[s, "angular"] = angular(lobe, radiance, SQUARE, EPS_ANGULAR)
        runs[s, "fixed"] = angular(lobe, radiance, (2, 2), EPS_ANGULAR)
        runs[s, "transforms"] = by_transforms(kept, radiance, SQUARE)
        runs[s, "sums"] = by_sums(kept, radiance, SQUARE)
        runs[s, "BRDF"] = lambda lobe=lobe, s=s: expand(lobe, EPS, order(s), 0)
    found = fastest(runs)
    rows = [
        (
            s, order(s), found[s, "angular"], max(found[s, "angular"] - found[s, "fixed"], 1e-6),
            found[s, "transforms"], found[s, "sums"], found[s, "BRDF"],
            found[s, "angular"] / found[s, "transforms"], found[s, "angular"] / found[s, "sums"],
            found[s, "angular"] / (found[s, "transforms"] + found[s, "BRDF"]),
        )
        for s in EXPONENTS
    ]  # fmt: skip
    return Study(
        "phong-prefiltering",
        f"Prefiltering for Phong lobes, S_L = S_B = {SIZE}, in both domains",
        f"Fastest of rounds in turns, {harmonics.threads()} threads, three channels, single precision, light: the "
        f"studio. Angular: cone of eps = {EPS_ANGULAR:g}; frequency: F = 1 + sqrt(6 s) rounded up, by ducc0's "
        "transforms and by the paper's separable sums. Less fixed: without what a map of 2 x 2 texels takes, the time "
        "to trace the kernel. The lobe's coefficients are made once for all lights.",
        ("s", "F", "angular (s)", "angular less fixed (s)", "frequency (s)", "by the paper's sums (s)",
         "lobe's coefficients (s)", "ratio", "ratio by the paper's sums", "ratio with the lobe's coefficients"),
        tuple(rows),
    )  # fmt: skip


def crossover() -> Study:
    """Return the exponent at which both domains take equal time, by the light's size."""
    rows: list[tuple[str | float | int | bool, ...]] = []
    for size in CROSSINGS:
        shape = size, 2 * size
        radiance, predicted = light(*shape), size ** (4 / 3)
        highest = ((size - 2) ** 2) / 6  # 2 F + 2 columns hold F
        exponents = np.geomspace(predicted / 4, min(highest, 6 * predicted), 5)
        runs: dict[tuple[int, str], Callable[[], Any]] = {}
        for i, s in enumerate(exponents):
            lobe = Phong(exponent=float(s), clipped=False)
            kept = expand(lobe, EPS, order(s), 0)
            runs[i, "angular"] = angular(lobe, radiance, shape, EPS_ANGULAR)
            runs[i, "sums"] = by_sums(kept, radiance, shape)
            runs[i, "transforms"] = by_transforms(kept, radiance, shape)
        found = fastest(runs)
        cost = {
            way: np.array([found[i, way] for i in range(len(exponents))]) for way in ("angular", "sums", "transforms")
        }
        for way, told in (("sums", "the paper's sums"), ("transforms", "ducc0's transforms")):
            found_at, inside = crossing(exponents, cost["angular"] / cost[way])
            rows.append(
                (
                    told,
                    size,
                    predicted,
                    found_at,
                    found_at / predicted,
                    inside,
                    float(exponents[0]),
                    float(exponents[-1]),
                )
            )
    return Study(
        "prefiltering-crossover",
        "Phong exponent s* at which both domains take equal time",
        "Beside S_L^(4/3) (RH 2002, sec. 6.3), S_B = S_L, maps of S x 2 S texels. The ratio of times is measured at "
        "five exponents; s* is where a "
        "power law fitted to it crosses 1: within the measured exponents, or beyond them.",
        ("way", "S_L", "S_L^(4/3)", "s*", "s* / S_L^(4/3)", "within the measured", "least s", "largest s"),
        tuple(rows),
    )


def crossing(s: NDArray[np.float64], ratio: NDArray[np.float64]) -> tuple[float, bool]:
    """Return where a power law fitted to a falling ratio is 1, and whether that is within the exponents `s`."""
    slope, offset = np.polyfit(np.log(s), np.log(ratio), 1)
    at = float(np.exp(-offset / slope)) if slope < 0 else float("inf")
    return at, bool(s[0] <= at <= s[-1])


def facet_times() -> Study:
    """Return orders and times of both domains for the simplified microfacet, by sigma."""
    radiance = light(SIZE)
    runs: dict[tuple[float, str], Callable[[], Any]] = {}
    kept: dict[float, LobeCoefficients] = {}
    for sigma in SIGMAS:
        lobe = Microfacet(sigma=sigma, clipped=False)
        kept[sigma] = c = expand(lobe, EPS_FACETS)
        shrm = by_transforms(c, radiance, SQUARE)
        runs[sigma, "shrm"] = shrm
        runs[sigma, "explicit"] = lambda c=c, shrm=shrm: explicit.views(c, shrm(), VIEWS)
        runs[sigma, "BRDF"] = lambda lobe=lobe, c=c: expand(lobe, EPS_FACETS, c.F, c.P)
    found = fastest(runs)
    images = FEW_VIEWS**2
    rows: list[tuple[float | int | bool, ...]] = []
    for sigma in SIGMAS:
        run = angular(Microfacet(sigma=sigma, clipped=False), radiance, SQUARE, EPS_FACETS, FEW_VIEWS)
        prefilter(radiance[:8, :8], Microfacet(sigma=sigma, clipped=False), (2, 2), EPS_FACETS, FEW_VIEWS)  # compiles
        an_image = timed(run)[1] / images
        shrm, all_maps, brdf = (found[sigma, way] for way in ("shrm", "explicit", "BRDF"))
        total = an_image * VIEWS**2
        rows.append((sigma, kept[sigma].F, kept[sigma].P, total, an_image, all_maps, shrm, total / all_maps,
                     an_image / shrm, bool(shrm < an_image), brdf))  # fmt: skip
    whole = timed(angular(Microfacet(sigma=SIGMAS[0], clipped=False), radiance, SQUARE, EPS_FACETS, VIEWS))[1]
    return Study(
        "facet-prefiltering",
        f"Prefiltering for the simplified microfacet, T_B = {VIEWS}, S_L = S_B = {SIZE}, in both domains",
        f"Least orders for eps = {EPS_FACETS:g}, and times of {VIEWS**2} maps. Angular: {images} of the {VIEWS**2} "
        f"maps are made and timed, and count {VIEWS**2 // images} times: the cone, and so the time, is that of every "
        "view. Frequency: fastest of rounds in turns; the SHRM from the light, and all maps from it.",
        ("sigma (rad)", "F", "P", "angular (s)", "angular, a map (s)", "frequency (s)", "SHRM (s)",
         "ratio", "a map over the SHRM", "SHRM faster than a map", "lobe's coefficients (s)"),
        tuple(rows),
        (f"All {VIEWS**2} angular maps at sigma = {SIGMAS[0]:g} took {whole:.3g} s; told are {rows[0][3]:.3g} s.",),
    )  # fmt: skip
