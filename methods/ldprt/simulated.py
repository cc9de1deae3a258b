"""Simulations that are kept: all methods and settings that ask the same of one shape share one."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field

from envbench.geometry import Geometry
from envbench.material import Medium
from methods.ldprt import subsurface
from methods.ldprt.transfer import Kind, Transfer, simulate


@dataclass(frozen=True)
class Request:
    """What is asked of a shape: see `methods.ldprt.transfer.simulate`; with a `medium`, `methods.ldprt.subsurface`."""

    order: int
    kind: Kind
    rays: int
    bounces: int
    albedo: float
    seed: int
    medium: Medium | None = None

    def simulated(self, geometry: Geometry) -> Transfer:
        """Simulate it."""
        if self.medium is not None:
            return subsurface.simulate(geometry, self.order, self.medium, rays=self.rays, seed=self.seed)
        return simulate(
            geometry,
            self.order,
            kind=self.kind,
            rays=self.rays,
            bounces=self.bounces,
            albedo=self.albedo,
            seed=self.seed,
        )


@dataclass
class Simulations:
    """The last simulations, at most `limit` of them."""

    limit: int = 4
    kept: OrderedDict[tuple[str, Request], Transfer] = field(default_factory=OrderedDict[tuple[str, Request], Transfer])

    def get(self, geometry: Geometry, request: Request) -> Transfer:
        """Return the transfer of a shape at rest, simulated if it is not kept; it says how long that took."""
        key = geometry.rest.key, request
        found = self.kept.pop(key, None) or request.simulated(geometry)
        self.kept[key] = found
        while len(self.kept) > self.limit:
            self.kept.popitem(last=False)
        return found


SIMULATIONS = Simulations()
"""Of this process. The first row of an asset pays for its simulation; every row says how long that took."""
