"""Every metric against a closed form or a slow obvious version, and what they do where there is nothing to compare."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage, stats
from skimage.metrics import peak_signal_noise_ratio

from envbench.errors import BadInput
from envbench.geometry import Points
from envbench.metrics import METRICS, paired_difference, score
from envbench.reference import Reference

H, W = 14, 17


def points(n, weight=None, image=False, size=(H, W)):
    z = np.tile([0.0, 0.0, 1.0], (n, 1))
    pixel = np.stack(np.divmod(np.arange(n), size[1]), 1).astype(np.int32) if image else None
    weight = np.full(n, 1 / n) if weight is None else np.asarray(weight)
    return Points(z, z, z, z, z, weight, pixel=pixel, image_shape=size if image else None)


def reference(replicates, where):
    replicates = np.asarray(replicates, np.float64)
    return Reference(replicates, where.weight, samples=1, seconds=0.0, key="k", target=1e-3)


def noisy(truth, sigma, rng, K=8):
    return truth + sigma * rng.standard_normal((K, *truth.shape))


def scores(values, ground, where, names=None):
    return {s.metric: s for s in score(np.asarray(values), ground, where, names)}


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_closed_forms_without_noise(rng):
    truth, where = rng.random((50, 3)), points(50)
    found = scores(1.1 * truth, reference([truth] * 8, where), where)
    # b = 1.1 r: each follows at once from its formula. Float64 sums of 150 terms.
    expected = {
        "nrmse": 0.1, "energy_ratio": 1.1, "captured_energy": 0.99,
        "max_error": 0.1 * truth.max() / np.sqrt(np.mean(truth**2)),
        "worst_view": 0.1 * np.sqrt((truth**2).mean(1).max() / np.mean(truth**2)),
        "rmse": 0.1 * np.sqrt(np.mean(truth**2)), "mse": 0.01 * np.mean(truth**2),
    }  # fmt: skip
    assert {name: s.value for name, s in found.items()} == pytest.approx(expected, rel=1e-10)
    for name in ("nrmse", "energy_ratio", "captured_energy"):
        assert (found[name].low, found[name].high) == pytest.approx((found[name].value,) * 2, rel=1e-6)
        assert not found[name].below_floor


def test_weights_are_the_points(rng):
    # Weight 3 is the same as the point three times.
    truth, result = rng.random((2, 3)), rng.random((2, 3))
    once, thrice = points(2, [0.25, 0.75]), points(4)
    again = [0, 1, 1, 1]
    a = score(result, reference(noisy(truth, 0.1, np.random.default_rng(1)), once), once)
    b = score(result[again], reference(noisy(truth, 0.1, np.random.default_rng(1))[:, again], thrice), thrice)
    assert [s.value for s in a] == pytest.approx([s.value for s in b], rel=1e-12)


@settings(deadline=None, max_examples=30, derandomize=True)
@given(st.floats(1e-6, 1e6))
def test_relative_metrics_do_not_see_the_unit_of_radiance(scale):
    rng = np.random.default_rng(2)
    where = points(H * W, image=True)
    truth, result = rng.random((2, H * W, 3))
    replicates = noisy(truth, 0.1, rng)
    relative = [m.name for m in METRICS.values() if m.relative]
    a = score(result, reference(replicates, where), where, relative)
    b = score(scale * result, reference(scale * replicates, where), where, relative)
    assert [s.value for s in a] == pytest.approx([s.value for s in b], rel=1e-9)


def test_interval_of_nrmse_covers_the_truth_and_exact_results_are_below_the_floor():
    rng = np.random.default_rng(3)
    where, truth, runs = points(40), rng.random((40, 3)), 300
    covered = floored = 0
    for _ in range(runs):
        ground = reference(noisy(truth, 0.02, rng), where)
        near, exact = (scores(v, ground, where, ["nrmse"])["nrmse"] for v in (1.02 * truth, truth))
        covered += near.low <= 0.02 <= near.high
        floored += exact.below_floor
        assert exact.high > 0
    bound = stats.binom.ppf(1e-4, runs, 0.93)
    assert covered >= bound
    assert floored >= bound


def test_energy_ratio_has_the_interval_of_its_denominator(rng):
    truth, where = rng.random((30, 3)), points(30)
    replicates = noisy(truth, 0.1, rng)
    found = scores(truth, reference(replicates, where), where)["energy_ratio"]
    low, high = stats.t.interval(0.95, 7, *(f(replicates.mean((1, 2))) for f in (np.mean, stats.sem)))
    # To first order in the noise of the mean, which is about 1 % here: the next order is its square.
    assert (found.low, found.high) == pytest.approx((truth.mean() / high, truth.mean() / low), abs=2e-4)


def test_max_error_tells_noise_from_error():
    rng = np.random.default_rng(4)
    where, truth = points(500), np.ones((500, 3))
    called_real = 0
    for _ in range(200):
        ground = reference(noisy(truth, 0.01, rng), where)
        called_real += not scores(truth, ground, where, ["max_error"])["max_error"].below_floor
    assert called_real <= stats.binom.isf(1e-4, 200, 0.05)
    wrong = truth.copy()
    wrong[7, 1] += 0.5
    found = scores(wrong, ground, where)["max_error"]
    assert not found.below_floor
    assert found.value == pytest.approx(0.5, abs=5 * 0.01 / np.sqrt(8))


def displayed(x, truth):
    white = np.percentile(0.2126 * truth[:, 0] + 0.7152 * truth[:, 1] + 0.0722 * truth[:, 2], 99)
    x = np.clip(x, 0, None) / white
    x = x / (1 + x)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)


def obvious_ssim(a, b):
    """Wang et al. 2004, eqs. 13 to 16, one channel; the window as the metric's formula words it."""

    def blur(x):
        return ndimage.gaussian_filter(x, 1.5, truncate=3.5)

    x, y = blur(a), blur(b)
    xx, yy, xy = blur(a * a) - x * x, blur(b * b) - y * y, blur(a * b) - x * y
    return (2 * x * y + 1e-4) * (2 * xy + 9e-4) / ((x * x + y * y + 1e-4) * (xx + yy + 9e-4))


def test_image_metrics_against_their_formulae(rng):
    n = H * W - 30  # the last pixels hold no point
    truth, where = rng.random((n, 3)), points(n, image=True)
    result = truth + 0.1 * rng.standard_normal((n, 3))
    found = scores(result, reference([truth] * 8, where), where)
    a, b = displayed(truth, truth), displayed(result, truth)
    assert found["psnr"].value == pytest.approx(peak_signal_noise_ratio(a, b, data_range=1), rel=1e-10)
    there = where.image(np.ones((n, 1)), empty=0)[..., 0] > 0
    maps = [obvious_ssim(where.image(a, 0)[..., c], where.image(b, 0)[..., c])[there] for c in range(3)]
    assert found["ssim"].value == pytest.approx(np.mean(maps), rel=1e-10)


def test_identical_images(rng):
    truth, where = rng.random((H * W, 3)), points(H * W, image=True)
    ground = reference([truth] * 8, where)
    found = scores(ground.mean, ground, where)
    assert found["psnr"].value == math.inf
    assert found["ssim"].value == pytest.approx(1, abs=1e-12)


def test_image_metrics_where_there_is_no_image_or_a_tiny_one(rng):
    truth = rng.random((50, 3))
    assert not {"ssim", "psnr"} & set(scores(truth, reference([truth] * 8, points(50)), points(50)))
    tiny = points(50, image=True, size=(5, 10))
    assert math.isnan(scores(truth, reference([truth] * 8, tiny), tiny)["ssim"].value)


@pytest.mark.parametrize("level", [0.0, 0.5])
def test_all_black_reference_leaves_the_absolute_error(level):
    where = points(H * W, image=True)
    found = scores(np.full((H * W, 3), level), reference(np.zeros((8, H * W, 3)), where), where)
    assert set(found) == {m.name for m in METRICS.values() if not m.splits}
    assert all(math.isnan(found[m.name].value) for m in METRICS.values() if m.relative and not m.splits)
    assert (found["rmse"].value, found["mse"].value) == pytest.approx((level, level**2), rel=1e-12)


def test_negative_results_are_scored(rng):
    truth, where = rng.random((H * W, 3)), points(H * W, image=True)
    found = scores(-truth, reference([truth] * 8, where), where)
    assert found["nrmse"].value == pytest.approx(2, rel=1e-10)
    assert all(math.isfinite(s.value) for s in found.values())


def test_pairs_rank_what_the_single_intervals_cannot():
    rng = np.random.default_rng(5)
    where, truth, runs = points(40), rng.random((40, 3)), 200
    covered = 0
    for _ in range(runs):
        ground = reference(noisy(truth, 0.1, rng), where)
        a, b = (scores(factor * truth, ground, where, ["nrmse"])["nrmse"] for factor in (1.050, 1.052))
        assert a.high > b.low
        low, high = paired_difference(b, a)
        covered += low <= 0.052**2 - 0.050**2 <= high
        assert high - low < (a.high**2 - a.low**2) / 5
    assert covered >= stats.binom.ppf(1e-4, runs, 0.95)


@pytest.mark.parametrize("name", ["nrmse", "rmse", "mse", "energy_ratio", "captured_energy"])
def test_paired_difference_is_antisymmetric(rng, name):
    where, truth = points(10), rng.random((10, 3))
    ground = reference(noisy(truth, 0.1, rng), where)
    a, b = (scores(factor * truth, ground, where, [name])[name] for factor in (1.0, 1.1))
    low, high = paired_difference(a, b)
    assert paired_difference(b, a) == pytest.approx((-high, -low))
    assert paired_difference(a, a) == (0, 0)


@pytest.mark.parametrize(("one", "other"), [("nrmse", "mse"), ("max_error", "max_error")])
def test_what_cannot_be_paired_is_refused(rng, one, other):
    where, truth = points(10), rng.random((10, 3))
    found = scores(truth, reference(noisy(truth, 0.1, rng), where), where)
    with pytest.raises(BadInput, match="take one metric with an interval"):
        paired_difference(found[one], found[other])


@pytest.mark.parametrize(
    ("values", "K", "names", "said"),
    [
        (np.ones((4, 3)), 8, None, r"shape \(5, 3\).*Got \(4, 3\)"),
        (np.ones(5), 8, None, r"Got \(5,\)"),
        (np.full((5, 3), np.nan), 8, None, "15 values of 15 that are NaN or infinite"),
        (np.full((5, 3), np.inf), 8, None, "NaN or infinite"),
        (np.ones((5, 3)), 2, None, "at least 3 replicates.*Got 2"),
        (np.ones((5, 3)), 8, ["nrsme"], "unknown metric 'nrsme': did you mean 'nrmse'"),
    ],
)
def test_bad_input_in_one_line(values, K, names, said):
    where = points(5)
    with pytest.raises(BadInput, match=said) as caught:
        score(values, reference(np.ones((K, 5, 3)), where), where, names)
    assert "\n" not in str(caught.value)


def test_asked_for_some_only(rng):
    truth, where = rng.random((5, 3)), points(5)
    found = score(truth, reference([truth] * 8, where), where, ["mse", "nrmse"])
    assert [s.metric for s in found] == ["nrmse", "mse"]


def test_the_registry_is_complete():
    assert all(name == m.name and m.title and m.formula for name, m in METRICS.items())


def test_nothing_heavy_is_imported_to_list_metrics():
    code = "import envbench.metrics, sys; print(sorted({'scipy', 'skimage', 'mitsuba', 'drjit'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
