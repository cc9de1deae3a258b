"""Which estimator serves light that scatters inside a shape."""

from __future__ import annotations

from data_gen.mitsuba_estimator import Estimator
from data_gen.mitsuba_surface import Surface
from data_gen.mitsuba_volume import Scattering
from data_gen.mitsuba_walk import Walk
from envbench.environment import Environment
from envbench.scene import Effect, Scene
from references.effects.facts import occasions


def walked(scene: Scene, variant: str) -> bool:
    """Whether walks do that look at the light where they end: it has no detail, or none that is simulated.

    Small lamps they would find by chance; and a scalar variant cannot run their loop.
    """
    if not scene.heeded:
        return False
    return Effect.LIGHT_DETAIL not in occasions(scene) & scene.effects and not variant.startswith("scalar")


def scattering(scene: Scene, surface: Surface, light: Environment) -> Estimator:
    """Return what renders a translucent surface under `light`, chosen for the `scene`."""
    return (Walk if walked(scene, surface.variant) else Scattering)(surface, light)
