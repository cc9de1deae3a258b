"""Glossy LDPRT: rows of a factored BRDF's transfer, each as zonal lobes, weighed by view factors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from envbench import real_harmonics
from envbench.directions import Array
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.material import Centre, Material
from envbench.method import Method
from envbench.scene import Effect, Scene
from methods.ldprt import fit, glossy, shade
from methods.ldprt.corners import Corners
from methods.ldprt.diffuse import NEEDS_MESH, chosen
from methods.ldprt.visibility import spread, visible


@dataclass(frozen=True, eq=False)
class Asset:
    """Lobes of each row at each vertex, the BRDF's view factors, and the frames (V, 3, 3) that these are seen in."""

    lobes: shade.Packed
    brdf: glossy.Factored
    frames: Array
    triangles: NDArray[np.int32]
    told: dict[str, Any]


@dataclass(frozen=True)
class GlossyLDPRT(Method):
    """n_b rows of transfer a vertex, N lobes each; a view weighs them (Sloan, Luna and Snyder 2005, eq. 16).

    Attributes
    ----------
    order : int
        n.
    rows : int
        n_b: singular values of the BRDF that are kept.
    lobes : int
        N, for each row.
    transfer : {"unshadowed", "shadowed"}
    rays : int
        Directions over the whole sphere that each vertex is asked about, the same for all.
    restarts : int
        Of the fit.
    """

    order: int = 4
    rows: int = 3
    lobes: int = 3
    transfer: str = "shadowed"
    rays: int = 1024
    restarts: int = 2

    name = "ldprt-glossy"
    summary = "stores a few rows of BRDF-specialised transfer at vertices as zonal lobes, weighed by maps over the view"
    source = "Sloan, Luna and Snyder 2005, eqs. 14 to 16"

    def __post_init__(self) -> None:
        if self.transfer not in ("unshadowed", "shadowed"):
            raise BadInput(f"transfer must be 'unshadowed' or 'shadowed'. Got '{self.transfer}' instead.")
        limits = {"order": (2, 12), "rows": (1, self.order**2), "rays": (16, 65536), "restarts": (0, 100)}
        limits["lobes"] = (1, 2 * self.order - 1)
        for key, (low, high) in limits.items():
            if not low <= getattr(self, key) <= high:
                raise BadInput(f"{key} must lie in [{low}, {high}]. Got {getattr(self, key)} instead.")

    def lacks(self, scene: Scene) -> frozenset[Effect]:
        shadows = {Effect.SELF_SHADOWING} if self.transfer == "shadowed" else set[Effect]()
        own = {Effect.VIEW_DEPENDENCE, Effect.PERSPECTIVE} | shadows
        return scene.effects - own

    def declines(self, scene: Scene) -> str | None:
        if scene.geometry.mesh is None:
            return NEEDS_MESH
        if any(lobe.centre is Centre.TANGENT for lobe in scene.material.lobes):
            return "holds isotropic BRDFs only; a lobe about the tangent is none"
        return None

    def prepare(self, material: Material, geometry: Geometry) -> Asset:
        """Factor the BRDF, cast rays, and fit every row."""
        mesh = geometry.mesh
        if mesh is None:
            raise BadInput(NEEDS_MESH)
        brdf, frames = glossy.factor(material, self.order, self.rows), glossy.frames(mesh.normals)
        if self.transfer == "unshadowed" or geometry.convex:
            vectors = glossy.unshadowed(brdf.rows, frames)
        else:
            directions = spread(self.rays)
            vectors = glossy.specialise(brdf.rows, frames, directions, visible(geometry, directions))
        found = fit.fit(vectors.reshape(-1, self.order**2), self.lobes, self.restarts)
        off = found.vectors().reshape(vectors.shape) - vectors
        several = (len(vectors), self.rows)
        packed = shade.pack(
            *(part.reshape(*several, *part.shape[1:]) for part in (found.axes, found.coefficients, found.direct))
        )
        told = {
            "vertices": len(vectors),
            "SVD error": brdf.svd_error,
            "fit error": float(np.sqrt((off**2).sum() / (vectors**2).sum())),
        }
        return Asset(packed, brdf, frames, mesh.triangles, told)

    def relight(self, prepared: Asset, environment: Environment) -> tuple[Asset, Array]:
        return prepared, real_harmonics.project(environment.radiance, self.order - 1)

    def shade(self, framed: tuple[Asset, Array], points: Points) -> NDArray[np.floating]:
        asset, light = framed
        corners = Corners.of(points, asset.triangles)
        rotations = None if points.rotation is None else corners.spread(points.rotation)
        frames = asset.frames[corners.lanes]
        factors = glossy.view_factors(asset.brdf, corners.spread(points.view), frames, rotations)
        return corners.blended(shade.evaluated(chosen(asset.lobes, corners.lanes), light, rotations, factors))

    def describe(self, prepared: Asset) -> dict[str, Any]:
        return prepared.told

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [cls(rows=1), cls(), cls(rows=7), cls(rows=7, lobes=5)]
