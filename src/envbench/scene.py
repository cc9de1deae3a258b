"""A scene: light, material, shape, queries, viewer, and the effects that ground truth simulates there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from envbench.environment import Environment
from envbench.geometry import Geometry, Points, Viewer
from envbench.material import Material


class Effect(StrEnum):
    """What light transport may have to account for beyond distant light on a point."""

    VIEW_DEPENDENCE = "view dependence"
    ANISOTROPY = "anisotropy"
    SELF_SHADOWING = "self-shadowing"
    INTERREFLECTION = "interreflection"
    SUBSURFACE = "subsurface"
    DEFORMATION = "deformation"
    PERSPECTIVE = "perspective"
    LIGHT_DETAIL = "light detail"


FREE = frozenset({Effect.VIEW_DEPENDENCE, Effect.ANISOTROPY, Effect.PERSPECTIVE, Effect.LIGHT_DETAIL})
"""Effects that cost ground truth nothing: the same rays are cast with them and without."""


class Plan(StrEnum):
    """How the effects of a scene are chosen: by need, by its facts alone, or all, facts unheeded."""

    AUTO = "auto"
    FACTS = "facts"
    ALL = "all"


class Basis(StrEnum):
    """What a decision rests on."""

    FACT = "fact"
    PROBE = "probe"
    USER = "user"


@dataclass(frozen=True)
class Decision:
    """Whether an effect is simulated on a scene, and why.

    Attributes
    ----------
    reason : str
        The fact, or what the probe found, in words.
    contribution, low, high : float
        RMS difference that leaving the effect out makes, over the RMS radiance with it, and its 98 % interval (each end
        is a 99 % bound); 0 where a fact rules the effect out, NaN where nothing was measured.
    cost : float
        Seconds that simulating it takes in reference and transfer; NaN where that is not known.
    saved : float
        Seconds that leaving it out saves; 0 where it is simulated.
    seconds : float
        What the probe took.
    bounces : int or None
        Of inter-reflection: how many are simulated.
    tolerance : float or None
        Contribution below which an effect may be left out; None where none was asked for.
    """

    effect: Effect
    simulated: bool
    basis: Basis
    reason: str
    contribution: float = float("nan")
    low: float = float("nan")
    high: float = float("nan")
    cost: float = float("nan")
    saved: float = 0.0
    seconds: float = 0.0
    bounces: int | None = None
    tolerance: float | None = None

    @property
    def missed(self) -> bool:
        """Whether a user has switched the effect off although it surely contributes more than may be left out."""
        return self.basis is Basis.USER and not self.simulated and self.low > (self.tolerance or 0.0)


def told(effects: str | Iterable[str] | None) -> str:
    """Return what sets a scene's name apart from that of the same scene with its usual effects, for which it is empty.

    Examples
    --------
    >>> told([Effect.SELF_SHADOWING, Effect.INTERREFLECTION]), told([]), told(None)
    (' [interreflection, self-shadowing]', ' [no effects]', '')
    >>> told(Plan.ALL), told(Plan.AUTO)
    (' [effects: all]', ' [effects: auto]')
    """
    if effects is None:
        return ""
    if isinstance(effects, str):
        return f" [effects: {effects}]"
    return f" [{', '.join(sorted(set(effects))) or 'no effects'}]"


@dataclass(frozen=True, eq=False)
class Scene:
    """One thing to render.

    Attributes
    ----------
    viewer : Viewer or None
        None where every point has a view of its own (uniform queries).
    effects : frozenset of Effect
        What the reference simulates here, neither more nor less; a method that lacks one is scored with the lack named.
        An effect that the scene has no occasion for makes no difference. By default those that cost nothing.
    order : int
        Bands of the light, l < order, that are left where its detail is not simulated.
    heeded : bool
        Whether ground truth makes use of what is known of the scene: closed forms, no rays on convex shapes, samples of
        each effect by what it contributes. Not where everything is to be simulated, facts unheeded (`Plan.ALL`).
    bounces : int or None
        How often light may come by way of the shape, where the scene calls for inter-reflection and that was worked
        out; None is as the reference's settings say.
    decisions : tuple of Decision
        Why each effect is simulated, or is not; empty where the effects were given.
    """

    name: str
    environment: Environment
    material: Material
    geometry: Geometry
    points: Points
    viewer: Viewer | None = None
    effects: frozenset[Effect] = FREE
    bounces: int | None = None
    decisions: tuple[Decision, ...] = ()
    order: int = 6
    heeded: bool = True
