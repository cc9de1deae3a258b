"""How the effects of a scene are chosen, as a suite's ``[effects]`` says, and what a user is told of the choice."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from envbench.errors import BadInput, unknown
from envbench.scene import Basis, Decision, Effect, Plan


class Probe(StrEnum):
    """Which effects are measured where facts do not rule them out: those that save time if left out, or all."""

    NEEDED = "needed"
    ALL = "all"


def chosen(effects: str | Iterable[str]) -> Plan | tuple[Effect, ...]:
    """Return a plan, or effects sorted and each once; raises `BadInput`, nearest name first, for what is neither.

    Examples
    --------
    >>> chosen(["self-shadowing", "anisotropy"])
    (<Effect.ANISOTROPY: 'anisotropy'>, <Effect.SELF_SHADOWING: 'self-shadowing'>)
    """
    if isinstance(effects, str):
        if effects not in list(Plan):
            raise unknown("plan of effects (or write a list of effects)", effects, Plan)
        return Plan(effects)
    for name in effects:
        if name not in list(Effect):
            raise unknown("effect", name, Effect)
    return tuple(sorted({Effect(name) for name in effects}))


@dataclass(frozen=True)
class EffectSettings:
    """Which effects ground truth simulates.

    Attributes
    ----------
    plan : Plan or tuple of Effect
        ``"auto"``: those whose contribution may exceed the tolerance. ``"facts"``: all that a scene has occasion for.
        ``"all"``: all, facts unheeded. A list: these, and it is measured what the others would have contributed.
    accuracy : float
        Error, relative to the RMS radiance, that matters to whoever asks.
    tolerance : float or None
        Contribution, relative to the RMS radiance, below which an effect is left out; None is a tenth of `accuracy`.
    order : int
        Bands of the light, l < order, beyond which its detail counts as an effect.
    probe : Probe
        ``"needed"``: an effect that costs nothing to simulate is simulated without being measured.
    budget : float or None
        Seconds that the probes of a scene may take before what is undecided is simulated; None is 5 % of what leaving
        effects out could save, 0.3 at least.
    """

    plan: str | tuple[str, ...] = Plan.AUTO
    accuracy: float = 0.05
    tolerance: float | None = None
    order: int = 6
    probe: str = Probe.NEEDED
    budget: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "plan", chosen(self.plan))
        for name in ("accuracy", "tolerance", "budget"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise BadInput(f"effects {name} must be a finite number > 0. Got {value} instead.")
        if not 1 <= self.order <= 64:
            raise BadInput(f"effects order must lie in [1, 64] bands. Got {self.order} instead.")
        if self.probe not in list(Probe):
            raise unknown("probe of effects", self.probe, Probe)

    @property
    def limit(self) -> float:
        """The tolerance, given or derived."""
        return self.accuracy / 10 if self.tolerance is None else self.tolerance


def warnings(decisions: Iterable[Decision], tolerance: float) -> tuple[str, ...]:
    """Return a line for each effect that the user left out though it matters, or may matter."""
    lines: list[str] = []
    for d in decisions:
        if d.basis is not Basis.USER or d.simulated or not d.high >= tolerance:
            continue
        matters = "matters" if d.low > tolerance else "may matter"
        lines.append(
            f"{d.effect} is left out as asked, but {matters}: it contributes {d.contribution:.2%} of the RMS radiance "
            f"({d.low:.2%} to {d.high:.2%}), tolerance {tolerance:.2%}"
        )
    return tuple(lines)
