"""Reflection-space image-based rendering: sphere maps at the vertices of an icosahedron, warped and blended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array, normalised
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, Viewer
from envbench.material import Centre, Material
from envbench.method import Method, Tolerance
from envbench.scene import Scene
from methods.angular import losses
from methods.cabral import icosahedron, spheremap
from methods.cabral.blend import blend
from methods.cabral.groups import Group, grouped
from methods.cabral.lookup import look_up
from methods.cabral.mesh import DiskMesh, disk_mesh
from methods.cabral.sources import from_shrm, integrated, queries
from methods.cabral.views import error_of_views
from methods.cabral.warp import source
from methods.shrm import SHRM

MAX_BYTES = 2**31
"""Of all sphere maps under one light."""
WARPS = ("auto", "mirror", "normal")
PREFILTERS = ("shrm", "angular")


@dataclass(frozen=True, eq=False)
class Prepared:
    """The asset: its groups of lobes, what SHRM prepares for each, and the tessellated disk, if there is one."""

    groups: tuple[Group, ...]
    shrm: tuple[Any, ...]
    mesh: DiskMesh | None


@dataclass(frozen=True, eq=False)
class Relit:
    """The sphere maps of each group, (K, size, size, 4) float32, the fourth value unused."""

    prepared: Prepared
    maps: tuple[NDArray[np.float32], ...]


@dataclass(frozen=True, eq=False)
class Framed:
    """One view: its axes (3, 3), and for each group what it is looked up by and its map (size, size, 4)."""

    axes: Array
    maps: tuple[tuple[Centre, NDArray[np.float32]], ...]


@dataclass(frozen=True)
class Cabral(Method):
    """Blend, for each view, the three nearest of 12 precomputed radiance sphere maps, warped to it.

    Lobes about R are warped so that mirror directions agree, lobes about N so that normals do: one set of maps each, as
    the paper proposes for BRDFs of several components. The paper has no lobe about a tangent; what is honest for one is
    a set of maps over T, warped so that tangents agree. Maps know a distant viewer: an eye is taken to see all along
    its axis, and only mirror directions are its own.

    Parameters
    ----------
    maps : {12, 42, 162}
        Vertices of the icosahedron, as it is, or with its edges halved once or twice.
    size : int
        Texels across a sphere map.
    prefilter : {"shrm", "angular"}
        Where the radiance of a map comes from: spherical harmonic reflection maps, or the paper's integral for each
        texel.
    warp : {"auto", "mirror", "normal"}
        "auto" warps each lobe by its own centre; else lobes about R and N share one set of maps and this warp.
    mesh : int
        0 warps each texel exactly; n interpolates between the vertices of a disk of n rings, as the paper draws it.
    fade : float
        How far from its singular point a source is fully trusted, in radii of the disk; 0 trusts it everywhere.
    eps : float
        What prefiltering may leave out: energy (shrm), share of the integral outside the cone (angular).
    light_rows : int
        For angular prefiltering, the light is reduced to so many rows; 0 takes it as given.
    """

    maps: int = 12
    size: int = 64
    prefilter: str = "shrm"
    warp: str = "auto"
    mesh: int = 0
    fade: float = 0.5
    eps: float = 0.01
    light_rows: int = 64

    name = "cabral"
    summary = "stores sphere maps seen from an icosahedron's vertices; three are warped to a view and blended"
    source = "Cabral, Olano and Nemec 1999, secs. 3 and 4"

    def __post_init__(self) -> None:
        if self.maps not in icosahedron.SUBDIVISIONS:
            raise BadInput(f"maps must be 12, 42 or 162. Got {self.maps} instead.")
        if not 4 <= self.size <= 1024:
            raise BadInput(f"size must lie in [4, 1024]. Got {self.size} instead.")
        for name, value, known in (("prefilter", self.prefilter, PREFILTERS), ("warp", self.warp, WARPS)):
            if value not in known:
                raise BadInput(f"{name} must be one of {', '.join(map(repr, known))}. Got '{value}' instead.")
        if self.mesh != 0 and not 2 <= self.mesh <= 64:
            raise BadInput(f"mesh must be 0 (exact) or lie in [2, 64]. Got {self.mesh} instead.")
        if not 0 <= self.fade <= 2:
            raise BadInput(f"fade must lie in [0, 2]. Got {self.fade} instead.")
        if not 0 < self.eps < 1:
            raise BadInput(f"eps must lie in (0, 1). Got {self.eps} instead.")
        if self.light_rows != 0 and not 2 <= self.light_rows <= 8192:
            raise BadInput(f"light_rows must be 0 or lie in [2, 8192]. Got {self.light_rows} instead.")
        if self.maps * self.size**2 * 16 > MAX_BYTES:
            gib = self.maps * self.size**2 * 16 / 2**30
            raise BadInput(f"its maps would take {gib:.1f} GiB; lower maps or size.")

    def declines(self, scene: Scene) -> str | None:
        if scene.viewer is None:
            return "it blends maps for one viewer, and here every point has a view of its own."
        if any(lobe.centre is Centre.TANGENT and lobe.clipped for lobe in scene.material.lobes):
            return "a lobe about the tangent, clipped at the horizon, also depends on the normal; maps over T cannot."
        return None

    def prepare(self, material: Material, geometry: Geometry) -> Prepared:
        """Group the lobes; expand each group's, if SHRM is to fill the maps; lay out the tessellated disk."""
        groups = grouped(material.lobes, self.warp)
        expanded = self._shrm.prepare if self.prefilter == "shrm" else lambda *_: None
        shrm = tuple(expanded(Material(material.name, group.lobes), geometry) for group in groups)
        return Prepared(groups, shrm, disk_mesh(self.mesh, self.size) if self.mesh else None)

    def relight(self, prepared: Prepared, environment: Environment) -> Relit:
        """Fill the maps of all vertices."""
        views, _ = icosahedron.sphere(self.maps)
        maps: list[NDArray[np.float32]] = []
        for group, expanded in zip(prepared.groups, prepared.shrm, strict=True):
            points = [queries(group.index, view, self.size) for view in views]
            if self.prefilter == "shrm":
                filled = from_shrm(self._shrm, expanded, environment, points)
            else:
                filled = integrated(group.lobes, environment, points, self.eps, self.light_rows)
            maps.append(filled.reshape(self.maps, self.size, self.size, 4))
        return Relit(prepared, tuple(maps))

    def frame(self, relit: Relit, viewer: Viewer | None) -> Framed:
        """Warp and blend the maps of the face that the viewer sees from."""
        if viewer is None:
            raise BadInput("cabral needs one viewer; give a distant direction or an eye.")
        towards = viewer.direction or tuple(-a for a in viewer.axis or (0.0, 0.0, 0.0))
        view = normalised(towards)
        axes = spheremap.frame(view)
        vertices, _ = icosahedron.sphere(self.maps)
        face, weights = icosahedron.subtended(self.maps, view)
        sources = [source(vertices[k], w, axes) for k, w in zip(face, weights, strict=True)]
        return Framed(
            axes,
            tuple(
                (group.index, blend(maps[face], sources, group.index is Centre.NORMAL, self.fade, relit.prepared.mesh))
                for group, maps in zip(relit.prepared.groups, relit.maps, strict=True)
            ),
        )

    def shade(self, framed: Framed, points: Points) -> NDArray[np.floating]:
        """Look each group's map up by its own direction, and add."""
        return look_up(framed.maps, framed.axes, points)

    def describe(self, prepared: Prepared) -> dict[str, Any]:
        out: dict[str, Any] = {
            f"maps by {group.index}": f"{self.maps} of {self.size}x{self.size}" for group in prepared.groups
        }
        if self.prefilter == "shrm":
            for group, expanded in zip(prepared.groups, prepared.shrm, strict=True):
                described = self._shrm.describe(expanded)
                out |= {f"maps by {group.index}: {key}": value for key, value in described.items()}
        return out

    def tolerance(self, prepared: Prepared) -> Tolerance:
        """Add what prefiltering, views and grids lose.

        Constant light: what prefiltering states, and `error_of_views`, a mean over directions of which 32 queries may
        show twice; groups by their share in the whole. Rotation: the same, and two lookups on grids of spacing
        h = 2 / size. A direction t from the disk's singular one lies t^2 / 8 from the rim: there the map goes as the
        root of that distance, and linear interpolation in the outermost ring, a share 2 h of all directions, errs by
        .35 sqrt(h) for a gradient of 1 per radian, h / 2 over all. A lobe warped by another centre than its own is off
        by half the edge d of a face, before the blend takes the first order away: 4 (d / 2)^2 / 8 for second
        derivatives of 4 (light that varies over half a radian).
        """
        constant, rotation = 0.0, 2 / self.size
        shares = losses.shares([(group.lobes, group.index) for group in prepared.groups])
        for group, expanded, share in zip(prepared.groups, prepared.shrm, shares, strict=True):
            lost = self._prefiltering_loses(group, expanded) + 2 * error_of_views(group, self.maps, self.fade)
            off = (icosahedron.longest_edge(self.maps) / 2) ** 2 / 2 if group.mismatched else 0.0
            constant, rotation = constant + share * lost, rotation + share * (lost + off)
        return Tolerance(constant_light=constant, rotation=rotation)

    def _prefiltering_loses(self, group: Group, expanded: Any) -> float:
        if self.prefilter == "shrm":
            return self._shrm.tolerance(expanded).constant_light
        return max(losses.of_prefiltering(lobe, self.eps, self.light_rows) for lobe in group.lobes)

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [
            cls(maps=12, size=32, eps=0.03),
            cls(maps=12, size=128, eps=0.003),
            cls(maps=42, size=64, eps=0.01),
            cls(maps=42, size=64, prefilter="angular"),
            cls(maps=162, size=64, eps=0.01),
        ]

    @property
    def _shrm(self) -> SHRM:
        return SHRM(eps=self.eps)
