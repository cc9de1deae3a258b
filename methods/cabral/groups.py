"""Which lobes share a set of maps."""

from __future__ import annotations

from dataclasses import dataclass

from envbench.material import Centre, Lobe


@dataclass(frozen=True)
class Group:
    """Lobes that share a set of maps, and the direction, R, N or T, that it is warped and looked up by."""

    index: Centre
    lobes: tuple[Lobe, ...]

    @property
    def mismatched(self) -> bool:
        """Whether some lobe is warped by another direction than its own centre."""
        return any(lobe.centre is not self.index for lobe in self.lobes)


def grouped(lobes: tuple[Lobe, ...], warp: str) -> tuple[Group, ...]:
    """Group lobes by their own centres for "auto"; else those about R and N together, under "mirror" or "normal"."""
    forced = {"mirror": Centre.REFLECTION, "normal": Centre.NORMAL}.get(warp)

    def index(lobe: Lobe) -> Centre:
        return lobe.centre if forced is None or lobe.centre is Centre.TANGENT else forced

    return tuple(
        Group(centre, chosen) for centre in Centre if (chosen := tuple(lobe for lobe in lobes if index(lobe) is centre))
    )
