"""An error split into what a method ignores and what it does approximately: synthetic references of known noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from data_gen.lobes import Lambertian
from envbench.attribution import sentence, split, without
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, Pose
from envbench.material import Material
from envbench.metrics import score
from envbench.records import CellResult, Score, Status
from envbench.reference import Reference
from envbench.scene import Effect, Scene

N, K = 30, 8
PARTS = ("nrmse", "missing_effects", "approximation", "cross")
SHADOWS, BOUNCES, DEFORMS, VIEWED = (
    Effect.SELF_SHADOWING, Effect.INTERREFLECTION, Effect.DEFORMATION, Effect.VIEW_DEPENDENCE,
)  # fmt: skip


def points(n: int = N) -> Points:
    z = np.tile([0.0, 0.0, 1.0], (n, 1))
    return Points(z, z, z, z, z, np.random.default_rng(9).uniform(0.5, 1.5, n))


def reference(replicates: np.ndarray, where: Points) -> Reference:
    return Reference(replicates, where.weight, samples=1, seconds=0.0, key="k", target=1e-3)


class Case:
    """A truth R, the truth Q without some effects, and a method's b; noise of the two references alike or apart."""

    def __init__(self, ignored: float, done: float, noise: float, shared: float = 0.0) -> None:
        rng = np.random.default_rng(1)
        self.points, self.noise, self.shared = points(), noise, shared
        self.R = rng.uniform(0.5, 1.5, (N, 3))
        self.Q = self.R + ignored * rng.uniform(0, 1, (N, 3))  # without shadows all is brighter
        self.b = self.Q + done * rng.standard_normal((N, 3)) - 0.3 * done

    @property
    def exact(self) -> dict[str, float]:
        w = (self.points.weight / self.points.weight.sum())[:, None] / 3
        power, M, A = (w * self.R**2).sum(), self.Q - self.R, self.b - self.Q
        return {
            "nrmse": float((w * (A + M) ** 2).sum() / power),
            "missing_effects": float((w * M**2).sum() / power),
            "approximation": float((w * A**2).sum() / power),
            "cross": float((w * A * M).sum() / power),
        }

    def scores(self, rng: np.random.Generator) -> dict[str, Score]:
        mine, other, both = self.noise * rng.standard_normal((3, K, N, 3))
        r = self.R + np.sqrt(1 - self.shared) * mine + np.sqrt(self.shared) * both
        q = self.Q + np.sqrt(1 - self.shared) * other + np.sqrt(self.shared) * both
        found = score(self.b, reference(r, self.points), self.points, PARTS, reference(q, self.points))
        return {s.metric: s for s in found}


def squared(found: Score, value: float) -> float:
    """Return a score as the estimate that is without bias: the square of a root, with its sign."""
    return value if found.metric == "cross" else float(np.sign(value) * value**2)


def unbiased(found: Score) -> float:
    """Return that estimate itself, from its leave-one-out values: their mean is it, for products across replicates."""
    return float(np.mean([squared(found, x) for x in found.jackknife]))


CASES = {
    "both": Case(0.4, 0.1, 0.05),
    "same seeds": Case(0.4, 0.1, 0.05, shared=0.9),
    "noise above both": Case(0.03, 0.02, 0.3),
    "nothing ignored": Case(0.0, 0.1, 0.1),
    "exact in what it does": Case(0.3, 0.0, 0.1),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_parts_are_unbiased_and_their_intervals_cover(case: Case) -> None:
    rng, runs = np.random.default_rng(2), 600
    found = [case.scores(rng) for _ in range(runs)]
    for name, exact in case.exact.items():
        values = np.array([unbiased(s[name]) for s in found])
        # p = 1e-4 each: of 2,400 sums the mean is normal; the floor on the spread is float64's. The power in the
        # denominator has a bias of its own, of the order of its variance: (noise / (sqrt(K) RMS))^2 / (N K).
        spread = stats.norm.isf(5e-5) * values.std() / np.sqrt(runs)
        assert abs(values.mean() - exact) < spread + 1e-12 + 1e-3 * abs(exact), name
        covered = sum(squared(s[name], s[name].low) <= exact <= squared(s[name], s[name].high) for s in found)
        if name != "cross" and exact < 1e-20:  # a root's interval is cut at 0
            covered = sum(s[name].low == 0 for s in found)
        assert covered >= stats.binom.ppf(1e-4, runs, 0.93), name


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_parts_and_cross_term_are_the_total(case: Case) -> None:
    """b - r_k = (b - q_k) + (q_k - r_k) for every k: not within an interval alone, but to rounding."""
    found = case.scores(np.random.default_rng(3))
    total, ignored, done, cross = (unbiased(found[name]) for name in PARTS)
    assert ignored + done + 2 * cross == pytest.approx(total, abs=1e-12)


def test_noise_of_both_references_is_taken_off() -> None:
    """Where noise is ten times the errors, roots of plain means would be of the noise alone."""
    case = CASES["noise above both"]
    found = case.scores(np.random.default_rng(4))
    plain = case.noise * np.sqrt(2 / K) / np.sqrt(np.mean(case.R**2))
    assert found["missing_effects"].value < plain / 2
    assert found["missing_effects"].below_floor
    assert found["missing_effects"].high > np.sqrt(case.exact["missing_effects"])


def test_without_noise_intervals_are_points() -> None:
    case = Case(0.4, 0.1, 0.0)
    for name, found in case.scores(np.random.default_rng(0)).items():
        exact = case.exact[name] if name == "cross" else np.sqrt(case.exact[name])
        assert (found.value, found.low, found.high) == pytest.approx((exact,) * 3, rel=1e-6)


def test_no_error_is_split_without_a_reference_to_split_it_by() -> None:
    case, where = CASES["both"], points()
    ground = reference(np.tile(case.R, (K, 1, 1)), where)
    assert not {s.metric for s in score(case.b, ground, where)} & set(PARTS[1:])
    fewer = reference(np.tile(case.Q, (K - 1, 1, 1)), where)
    with pytest.raises(BadInput, match=r"must have shape \(8, 30, 3\).*Got \(7, 30, 3\)"):
        score(case.b, ground, where, without=fewer)


def scene(*effects: Effect, posed: bool = False, placed: bool = True) -> Scene:
    pose = Pose("bent", np.eye(3), np.eye(3), np.tile(np.eye(3), (3, 1, 1))) if posed else None
    where = points(2)
    if placed:
        where = replace(where, triangle=np.zeros(2, np.int32), barycentric=np.full((2, 3), 1 / 3))
    shape = replace(Geometry("sphere"), pose=pose)
    light, white = Environment("l", np.ones((4, 8, 3), np.float32)), Material("m", (Lambertian(),))
    return Scene("s", light, white, shape, where, None, frozenset(effects), bounces=5)


@pytest.mark.parametrize(
    ("there", "lacks", "left"),
    [
        ({SHADOWS}, {SHADOWS}, set[Effect]()),
        ({SHADOWS, VIEWED}, {SHADOWS}, {VIEWED}),
        ({SHADOWS, BOUNCES}, {BOUNCES}, {SHADOWS}),
        ({SHADOWS, BOUNCES, DEFORMS, VIEWED}, {SHADOWS}, {VIEWED}),  # what rests on shadows goes with them
        ({SHADOWS, BOUNCES, DEFORMS}, {DEFORMS}, {SHADOWS, BOUNCES}),
        ({SHADOWS, VIEWED}, {VIEWED}, {SHADOWS}),
        ({SHADOWS}, set[Effect](), None),
    ],
)
def test_what_a_reference_without_effects_simulates(
    there: set[Effect], lacks: set[Effect], left: set[Effect] | None
) -> None:
    less = without(scene(*there), lacks)
    assert (None if less is None else less.effects) == left
    assert less is None or less.bounces == 5


def test_points_that_say_not_where_they_are_at_rest_leave_deformation_in() -> None:
    both = (SHADOWS, DEFORMS)
    assert without(scene(*both, posed=True, placed=False), {DEFORMS}) is None
    assert without(scene(*both, posed=True), {DEFORMS}) is not None
    less = without(scene(*both, posed=True, placed=False), set(both))
    assert less is not None
    assert not less.effects


def test_the_sentence_needs_all_parts() -> None:
    cell = CellResult("k", "s", "m", {}, Status.OK, scores=(Score("approximation", 0.1),), lacks=("self-shadowing",))
    assert split(cell) is None
    assert sentence(cell, lambda s: f"{s.value}") == ""
