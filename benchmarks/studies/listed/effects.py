"""Studies of which effects scenes call for."""

from __future__ import annotations

from collections.abc import Callable

from envbench.records import Study


def _effects_known() -> Study:
    """Effects planned on scenes of known answer: which, and what leaving out the others saves."""
    from benchmarks.studies import effect_plans

    return effect_plans.effects_known()


def _effects_random() -> Study:
    """Decisions about effects on random scenes: how many are wrong, how many needless, what they save."""
    from benchmarks.studies import effect_trials

    return effect_trials.effects_random()


STUDIES: dict[str, Callable[[], Study]] = {
    "effects-known": _effects_known,
    "effects-random": _effects_random,
}
