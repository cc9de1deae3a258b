"""A scene: light, material, shape, queries, viewer, and the effects that ground truth simulates there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
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


def told(effects: Iterable[Effect] | None) -> str:
    """Return what sets a scene's name apart from that of the same scene with its usual effects, for which it is empty.

    Examples
    --------
    >>> told([Effect.SELF_SHADOWING, Effect.INTERREFLECTION]), told([]), told(None)
    (' [interreflection, self-shadowing]', ' [no effects]', '')
    """
    return "" if effects is None else f" [{', '.join(sorted(set(effects))) or 'no effects'}]"


@dataclass(frozen=True, eq=False)
class Scene:
    """One thing to render.

    Attributes
    ----------
    viewer : Viewer or None
        None where every point has a view of its own (uniform queries).
    effects : frozenset of Effect
        What the reference simulates here; a method that lacks one is scored with the lack named.
    """

    name: str
    environment: Environment
    material: Material
    geometry: Geometry
    points: Points
    viewer: Viewer | None = None
    effects: frozenset[Effect] = field(default=frozenset())
