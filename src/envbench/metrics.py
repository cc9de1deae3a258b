"""Metrics: how far a result is from ground truth, and how sure that is (CONVENTIONS.md, Error).

In the formulae b is the result and r_k the K replicates of the reference, r their mean, s^2 their variance (K - 1),
<x> the mean over points (by weight) and channels.

Where a method lacks effects, q_k are the replicates of the reference without them, and b - r = (b - q) + (q - r): what
it does but approximately, and what it ignores. Of both, and of their product, the mean over replicates k != l is taken,
which no noise biases; so missing effects^2 + approximation^2 + 2 cross = NRMSE^2 (`envbench.attribution`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.errors import BadInput, unknown
from envbench.geometry import Points
from envbench.records import Score
from envbench.reference import Reference
from envbench.tonemap import FORMULA, displayed
from envbench.uncertainty import Estimate, difference, mean, product, square, t_quantile

Array = NDArray[np.float64]

_ROOTS = ("nrmse", "rmse", "missing_effects", "approximation")  # leave-one-out values are signed roots of squares


class Direction(StrEnum):
    """Which way is better."""

    LOWER = "lower"
    HIGHER = "higher"
    ONE = "one"


@dataclass(frozen=True, eq=False)
class Comparison:
    """A result (n, 3), its reference and the points both belong to; what several metrics need, computed once.

    `without` is the reference without the effects that the method lacks, of as many replicates; None if there is none.
    """

    values: Array
    reference: Reference
    points: Points
    without: Reference | None = None

    @cached_property
    def weight(self) -> Array:
        """Weight of each value (n, 1): a weighted sum over points and channels is a mean."""
        weight = np.asarray(self.points.weight, np.float64)
        return (weight / (3 * weight.sum()))[:, None]

    @cached_property
    def square_error(self) -> Estimate:
        """<(b - r)^2 - s^2 / K>."""
        return square(self._products(self.values - self.reference.replicates))

    @cached_property
    def power(self) -> Estimate:
        """<r^2 - s^2 / K>."""
        return square(self._products(self.reference.replicates))

    @cached_property
    def lit(self) -> bool:
        """Whether relative errors are defined: the reference's power is above zero, whichever replicate is left out."""
        return bool(self.power.value > 0 and (self.power.jackknife > 0).all())

    @cached_property
    def relative(self) -> Estimate:
        """The squared NRMSE."""
        return self.square_error.over(self.power)

    @cached_property
    def missing(self) -> Estimate:
        """<(q - r)^2>, relative to the power."""
        return square(self._products(self._ignored)).over(self.power)

    @cached_property
    def approximation(self) -> Estimate:
        """<(b - q)^2>, relative to the power."""
        return square(self._products(self._done)).over(self.power)

    @cached_property
    def cross(self) -> Estimate:
        """<(b - q) (q - r)>, relative to the power."""
        both = self._products(self._done, self._ignored)
        return product(both, square(self._products(self._done)), square(self._products(self._ignored))).over(self.power)

    @property
    def _ignored(self) -> Array:
        assert self.without is not None
        return self.without.replicates - self.reference.replicates

    @property
    def _done(self) -> Array:
        assert self.without is not None
        return self.values - self.without.replicates

    @cached_property
    def shown(self) -> tuple[Array, Array]:
        """Reference and result (n, 3) as a screen shows them."""
        truth = self.reference.mean
        return displayed(truth, truth), displayed(self.values, truth)

    def _products(self, d: Array, e: Array | None = None) -> Array:
        """Return <d_k e_l>, (K, K), of errors (K, n, 3); those of d with itself where there is no e."""
        weight = np.sqrt(self.weight)
        flat = (d * weight).reshape(len(d), -1)
        return flat @ (flat if e is None else (e * weight).reshape(len(e), -1)).T


@dataclass(frozen=True)
class Metric:
    """One entry of the registry; `formula` is printed wherever the metric is.

    `function` computes it; it is not called where the metric is undefined: a relative one on an all-black reference.
    """

    name: str
    title: str
    formula: str
    direction: Direction
    unit: str
    function: Callable[[Comparison], Score]
    relative: bool = True
    needs_image: bool = False
    splits: bool = False
    """Splits the error of a method that lacks effects: needs the reference without them."""


def score(
    values: NDArray[np.floating],
    reference: Reference,
    points: Points,
    names: Iterable[str] | None = None,
    without: Reference | None = None,
) -> tuple[Score, ...]:
    """Score a result against its reference.

    Parameters
    ----------
    values : (n, 3)
        Reflected radiance at the points, W sr^-1 m^-2.
    names : iterable of str, optional
        Metrics wanted; all by default. Those that need an image are left out where the points form none.
    without : Reference, optional
        At the same points, without the effects that the method lacks; without it no error is split.

    Returns
    -------
    tuple of Score
        In the order of `METRICS`. The value is NaN where a metric is undefined (all-black reference).

    Raises
    ------
    BadInput
        The values have the wrong shape or are not finite; fewer than 3 replicates, or not as many in both references;
        an unknown metric.
    """
    wanted = set(METRICS if names is None else names)
    for name in sorted(wanted - set(METRICS)):
        raise unknown("metric", name, METRICS)
    K, *shape = reference.replicates.shape
    if K < 3:
        raise BadInput(f"a reference needs at least 3 replicates to be scored against. Got {K} instead.")
    if list(values.shape) != shape or shape != [len(points), 3]:
        raise BadInput(f"the result must have shape ({len(points)}, 3), as the reference. Got {values.shape} instead.")
    if without is not None and without.replicates.shape != reference.replicates.shape:
        raise BadInput(
            f"a reference without effects must have shape {reference.replicates.shape}, as that with them. "
            f"Got {without.replicates.shape} instead."
        )
    bad = int(np.count_nonzero(~np.isfinite(values)))
    if bad:
        raise BadInput(f"the result holds {bad} values of {values.size} that are NaN or infinite: mend the method.")
    case = Comparison(np.asarray(values, np.float64), reference, points, without)
    there = [m for m in METRICS.values() if m.name in wanted and (points.pixel is not None or not m.needs_image)]
    chosen = [m for m in there if without is not None or not m.splits]
    return tuple(m.function(case) if case.lit or not m.relative else Score(m.name, np.nan) for m in chosen)


def paired_difference(a: Score, b: Score) -> tuple[float, float]:
    """Return the 95 % interval of a - b, for one metric and the same replicates: only if it excludes 0 do they differ.

    Roots (`nrmse`, `rmse`) are compared as squares, a^2 - b^2, whose estimate is unbiased below the noise floor too.

    Raises
    ------
    BadInput
        Different metrics, or a metric without leave-one-out values.
    """
    if a.metric != b.metric or len(a.jackknife) != len(b.jackknife) or not a.jackknife:
        raise BadInput(f"scores '{a.metric}' and '{b.metric}' cannot be paired: take one metric with an interval.")
    x, y = np.array(a.jackknife), np.array(b.jackknife)
    return difference(x * np.abs(x), y * np.abs(y)) if a.metric in _ROOTS else difference(x, y)


def _plain(name: str, estimate: Estimate, below_floor: bool = False) -> Score:
    return Score(name, estimate.value, *estimate.interval, below_floor, tuple(estimate.jackknife.tolist()))


def _square(name: str, estimate: Estimate) -> Score:
    return _plain(name, estimate, below_floor=estimate.interval[0] <= 0)


def _root(name: str, estimate: Estimate) -> Score:
    low, high = np.sqrt(np.maximum(estimate.interval, 0.0)).tolist()
    without = np.sign(estimate.jackknife) * np.sqrt(np.abs(estimate.jackknife))
    value = float(np.sqrt(max(estimate.value, 0.0)))
    return Score(name, value, low, high, estimate.interval[0] <= 0, tuple(without.tolist()))


def _energy_ratio(case: Comparison) -> Score:
    energy = mean((case.reference.replicates * case.weight).sum((1, 2)))
    result = float((case.values * case.weight).sum())
    if not energy.value > 0:
        return Score("energy_ratio", np.nan)
    return _plain("energy_ratio", Estimate(result / energy.value, result / energy.jackknife))


def _captured_energy(case: Comparison) -> Score:
    low, high = case.relative.interval
    without = tuple((1 - case.relative.jackknife).tolist())
    return Score("captured_energy", 1 - case.relative.value, 1 - high, 1 - low, low <= 0, without)


def _max_error(case: Comparison) -> Score:
    # Among n values the largest is where noise happened to be large: 4 standard errors there would call most exact
    # results wrong (7 degrees of freedom, 49,152 values). Bonferroni's bound holds for them all.
    error = np.abs(case.values - case.reference.mean)
    at = np.unravel_index(np.argmax(error), error.shape)
    bound = t_quantile(1 - 0.025 / error.size, len(case.reference.replicates) - 1)
    noise = bool(error[at] <= bound * case.reference.standard_error[at])
    return Score("max_error", float(error[at] / np.sqrt(case.power.value)), below_floor=noise)


def _worst_view(case: Comparison) -> Score:
    error = np.mean((case.values - case.reference.mean) ** 2, axis=1)
    noise = np.mean(case.reference.standard_error**2, axis=1)
    at = int(np.argmax(error - noise))
    # As for max_error: that the largest of n is no chance needs Bonferroni's bound.
    bound = t_quantile(1 - 0.025 / error.size, len(case.reference.replicates) - 1) ** 2
    value = math.sqrt(max(float(error[at] - noise[at]), 0.0) / case.power.value)
    return Score("worst_view", value, below_floor=bool(error[at] <= bound * noise[at]))


def _psnr(case: Comparison) -> Score:
    # scikit-image's, without its import: that brings all of scipy.stats, over a second in each new worker.
    truth, shown = case.shown
    power = float(np.mean((truth - shown) ** 2))
    return Score("psnr", -10 * math.log10(power) if power > 0 else math.inf)


def _ssim(case: Comparison) -> Score:
    from skimage.metrics import structural_similarity

    points = case.points
    if min(points.image_shape or (0, 0)) < 11:  # the window
        return Score("ssim", np.nan)
    truth, shown = (points.image(v, empty=0) for v in case.shown)
    mean_and_map: Any = structural_similarity(
        truth, shown, data_range=1, channel_axis=-1, full=True,
        gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
    )  # fmt: skip
    there = points.image(np.ones((len(points), 1)), empty=0)[..., 0] > 0
    return Score("ssim", float(mean_and_map[1][there].mean()))


_ACROSS = "[x y] the mean over k != l of <x_k y_l>, q the reference without the effects that the method lacks"
_SHOWN = f"b and r shown as {FORMULA}"

METRICS: dict[str, Metric] = {
    m.name: m
    for m in (
        Metric(
            "nrmse", "NRMSE", "sqrt(max(<(b - r)^2 - s^2/K>, 0) / <r^2 - s^2/K>)",
            Direction.LOWER, "", lambda c: _root("nrmse", c.relative),
        ),
        Metric("energy_ratio", "energy ratio", "<b> / <r>", Direction.ONE, "", _energy_ratio),
        Metric(
            "captured_energy", "captured energy", "1 - <(b - r)^2 - s^2/K> / <r^2 - s^2/K>",
            Direction.HIGHER, "", _captured_energy,
        ),
        Metric(
            "max_error", "maximum error", "max |b - r| / sqrt(<r^2 - s^2/K>), over points and channels",
            Direction.LOWER, "", _max_error,
        ),
        Metric(
            "worst_view", "worst view",
            "max over points of sqrt(max([(b - r)^2 - s^2/K], 0) / <r^2 - s^2/K>), [x] the mean over channels",
            Direction.LOWER, "", _worst_view,
        ),
        Metric(
            "ssim", "SSIM",
            f"{_SHOWN}; Gaussian window, sigma 1.5, K1 = .01, K2 = .03; pixels without a point are 0 in both, "
            "and left out of the mean",
            Direction.HIGHER, "", _ssim, needs_image=True,
        ),
        Metric(
            "psnr", "PSNR", f"-10 log10 of the unweighted mean over points of (b - r)^2; {_SHOWN}",
            Direction.HIGHER, "dB", _psnr, needs_image=True,
        ),
        Metric(
            "rmse", "RMSE", "sqrt(max(<(b - r)^2 - s^2/K>, 0))",
            Direction.LOWER, "W sr^-1 m^-2", lambda c: _root("rmse", c.square_error), relative=False,
        ),
        Metric(
            "mse", "MSE", "<(b - r)^2 - s^2/K>",
            Direction.LOWER, "W^2 sr^-2 m^-4", lambda c: _square("mse", c.square_error), relative=False,
        ),
        Metric(
            "missing_effects", "missing effects", f"sqrt(max([(q - r)^2], 0) / <r^2 - s^2/K>), {_ACROSS}",
            Direction.LOWER, "", lambda c: _root("missing_effects", c.missing), splits=True,
        ),
        Metric(
            "approximation", "approximation", f"sqrt(max([(b - q)^2], 0) / <r^2 - s^2/K>), {_ACROSS}",
            Direction.LOWER, "", lambda c: _root("approximation", c.approximation), splits=True,
        ),
        Metric(
            "cross", "cross term",
            f"[(b - q) (q - r)] / <r^2 - s^2/K>, {_ACROSS}; "
            "missing effects^2 + approximation^2 + 2 cross term = NRMSE^2, each before its root is cut at 0",
            Direction.LOWER, "", lambda c: _plain("cross", c.cross), splits=True,
        ),
    )
}  # fmt: skip
"""Every metric by name, the principal one first."""
