"""What a scene looks like with effects and without: which variants are held against each other, and what shows them.

Everything is held against the scene with all effects that it has occasion for ("full"), but self-shadowing: without it
there is nothing to reflect light onto the shape, so with and without it are compared without bounces. Light that
scatters inside is held against an opaque surface that shadows itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from envbench import real_harmonics
from envbench.directions import Array
from envbench.scene import Effect, Scene
from references.effects.bounces import rest_of_bounces
from references.effects.facts import Fact, occasions, opaque
from references.effects.probe import SHADOWED, Bound, Estimators, Looks, Variant

SHADOWS, BOUNCES, POSED = Effect.SELF_SHADOWING, Effect.INTERREFLECTION, Effect.DEFORMATION
INSIDE = Effect.SUBSURFACE
_MOST_BANDS = 8
"""Bands up to which light without detail is seen beside the light itself, by the same paths."""


@dataclass
class Variants:
    """A scene's variants, and how looks show them.

    Attributes
    ----------
    known : dict
        What the facts say of each effect.
    bounces : int
        Of the full variant, where it has occasion for any.
    detail : bool
        Whether the scene without light detail is to be seen by the same paths.
    """

    scene: Scene
    known: dict[Effect, Fact]
    bounces: int
    detail: bool = False
    estimators: Estimators = field(default_factory=Estimators)

    @property
    def full(self) -> Variant:
        """All effects that the scene has occasion for."""
        effects = frozenset(e for e, fact in self.known.items() if fact.occasion)
        return Variant(effects, self.bounces if BOUNCES in effects else 0)

    def less(self, effect: Effect) -> Variant:
        """Return the variant that an effect is missing from; without shadows there are no bounces either."""
        effects = self.lacking({effect})
        if effect is SHADOWS:
            effects -= {BOUNCES, POSED}
        return Variant(effects, self.full.bounces if BOUNCES in effects else 0)

    def lacking(self, without: set[Effect]) -> frozenset[Effect]:
        """Return all effects but some; what light does not scatter in shadows itself, where it can."""
        return (self.full.effects - without) | ({SHADOWS} & self.opaque if INSIDE in without else set())

    @cached_property
    def opaque(self) -> frozenset[Effect]:
        """What the scene has occasion for without its medium."""
        return occasions(opaque(self.scene))

    def rendered(self, looks: Looks, variant: Variant) -> Array:
        """Return what a variant looks like, (K, n, 3)."""
        source, full = self.source(variant), self.full
        if not self._kin(source):
            return looks.bounced(source, self.estimators)[variant.bounces if source == full else -1]
        looks.apart(source, self.estimators, self._bands)
        if SHADOWS not in variant.effects:
            return looks.seen[Variant(variant.effects - SHADOWED, 0)][0]
        found = looks.seen[Variant(variant.effects | full.effects & {BOUNCES}, full.bounces)]
        return found[min(variant.bounces, len(found) - 1)]  # at rest, a shape may be convex

    def source(self, variant: Variant) -> Variant:
        """Return the variant whose rendering shows this one.

        One kernel shows the full one, fewer bounces, no shadows, and no light detail; it serves other views and the
        shape at rest too.
        """
        full, also = self.full, {BOUNCES}
        if INSIDE not in full.effects:
            also |= SHADOWED if SHADOWS not in variant.effects else set()
            also |= {Effect.LIGHT_DETAIL} if self._bands else set()
        source = Variant(variant.effects | full.effects & also, full.bounces)
        return source if source == full or self._kin(source) else variant

    def _kin(self, source: Variant) -> bool:
        """Whether a variant's kernel is that of the full one."""
        full = self.full.effects
        return INSIDE not in full and full - source.effects <= {POSED, Effect.PERSPECTIVE}

    @cached_property
    def _bands(self) -> tuple[Array, ...]:
        """The harmonics of the light without detail, if that is to be seen."""
        if not self.detail or self.scene.order > _MOST_BANDS:
            return ()
        return (real_harmonics.project(self.scene.environment.radiance.astype(np.float64), self.scene.order - 1),)

    def whole(self, looks: Looks) -> Array:
        """Return what a scene looks like with all effects, (K, n, 3)."""
        return self.rendered(looks, self.full)

    def pair(self, looks: Looks, effect: Effect) -> tuple[Array, Array]:
        """Return what a scene looks like with an effect and without it, (K, n, 3) each."""
        full, less = self.compared(effect)
        return self.rendered(looks, full), self.rendered(looks, less)

    def compared(self, effect: Effect) -> tuple[Variant, Variant]:
        """Return the variants whose difference is what an effect contributes: with it, and without."""
        return Variant(self.full.effects, 0) if effect is SHADOWS else self.full, self.less(effect)

    def measured(self, looks: Looks, effect: Effect) -> list[Bound]:
        """Return what leaving an effect out makes: of bounces, all of them, all but one, all but two ..."""
        if effect is not BOUNCES:
            return [looks.bound(*self.pair(looks, effect))]
        full, most = self.whole(looks), self.full.bounces
        rests = [looks.bound(full, self.rendered(looks, Variant(self.full.effects, k))) for k in range(most)]
        known = rest_of_bounces(self.scene, most) / _rms(full)
        return [replace(b, high=min(b.high, float(m))) for b, m in zip(rests, known, strict=True)]


def _rms(values: Array) -> float:
    """Return nine tenths of the RMS of replicates (K, n, 3): less than it is."""
    return 0.9 * float(np.sqrt((values.mean(0) ** 2).mean()))
