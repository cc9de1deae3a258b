"""What reflects: a BRDF as a sum of lobes, each about its own central direction (RH 2002, sec. 3.1)."""

from __future__ import annotations

import hashlib
import inspect
from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from envbench.arrays import dot, namespace
from envbench.errors import BadInput


class Centre(StrEnum):
    """The central direction of a lobe."""

    REFLECTION = "R"
    NORMAL = "N"
    TANGENT = "T"


@dataclass(frozen=True, kw_only=True)
class Lobe(ABC):
    """One lobe rho_hat = rho * max(N.L, 0) of a BRDF, the cosine included (RH 2002, eq. 2).

    All vectors are component-first (`envbench.arrays`), unit, and point away from the surface: `light` L, `view` V,
    `centre` C (R, N or T by `Lobe.centre`) and `normal` N. A formula is written once, for NumPy and Dr.Jit.

    Attributes
    ----------
    reflectance : (r, g, b)
        Scales the lobe.
    clipped : bool
        True: zero where N.L <= 0, as an opaque surface is. False: whole, as the papers integrate it.
    """

    reflectance: tuple[float, float, float] = (1.0, 1.0, 1.0)
    clipped: bool = True

    centre: ClassVar[Centre]
    channels: ClassVar[int] = 1
    """Values that `profile` returns: 1 where the shape is the same for r, g and b, else 3."""

    def __post_init__(self) -> None:
        if len(self.reflectance) != 3 or not all(np.isfinite(r) and r >= 0 for r in self.reflectance):
            raise BadInput(f"reflectance must be three finite numbers >= 0. Got {self.reflectance} instead.")

    @property
    def radially_symmetric(self) -> bool:
        """Whether the lobe, clipping included, depends on C.L alone, so that P = 0 is exact."""
        return False

    @property
    def azimuthally_symmetric(self) -> bool:
        """Whether the lobe, clipping included, depends on C.L and C.V alone, so that q = 0 is exact."""
        return self.radially_symmetric

    @property
    def key(self) -> str:
        """Content address: parameters and source code (of the folder, for lobes share formulae).

        A lobe that holds arrays shows their digest in its `repr`.
        """
        folder = Path(inspect.getfile(type(self))).parent
        return repr(self) + "\0".join(path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.py")))

    @abstractmethod
    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        """Return the whole lobe's value in 1/sr, before `reflectance` and clipping: `channels` arrays."""

    @abstractmethod
    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> tuple[Any, Any, Any]:
        """Map two uniform numbers to a direction of the whole lobe; a zero vector where there is none."""

    @abstractmethod
    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        """Return the probability density, per sr, with which `sample` draws `light`."""

    @abstractmethod
    def cone(self, eps: float) -> float:
        """Return the half-angle in (0, pi] about C that holds 1 - eps of the whole lobe's integral, for any view."""

    def evaluate(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, Any, Any]:
        """Return rho_hat for r, g and b, in 1/sr, clipped if the lobe is."""
        xp = namespace(light[0], view[0], centre[0], normal[0])
        values = self.profile(light, view, centre, normal)
        if self.clipped:
            above = dot(normal, light) > 0
            values = tuple(xp.where(above, v, 0.0) for v in values)
        r, g, b = values * 3 if self.channels == 1 else values
        return r * self.reflectance[0], g * self.reflectance[1], b * self.reflectance[2]


@dataclass(frozen=True, eq=False)
class Texture:
    """A map that multiplies a material's reflectance: `values` (H, W, 3), linear, in [0, 1], row 0 at v = 0.

    Texels are centred at ((j + 1/2) / W, (i + 1/2) / H); between them it is bilinear, and it repeats beyond [0, 1].
    """

    name: str
    values: NDArray[np.float32]

    @cached_property
    def key(self) -> str:
        """Content address."""
        return hashlib.sha256(repr(self.values.shape).encode() + self.values.tobytes()).hexdigest()


@dataclass(frozen=True)
class Medium:
    """What fills a translucent shape: homogeneous, scattering alike in all directions, of the index of what is outside.

    Attributes
    ----------
    mean_free_path : float
        Of light between two events, in the mesh's own unit.
    albedo : float
        Share of light that an event scatters instead of absorbing.
    """

    mean_free_path: float
    albedo: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.mean_free_path < np.inf:
            raise BadInput(f"mean_free_path must be a length > 0. Got {self.mean_free_path} instead.")
        if not 0 < self.albedo <= 1:
            raise BadInput(f"albedo must lie in (0, 1]. Got {self.albedo} instead.")


@dataclass(frozen=True)
class Material:
    """A BRDF: the sum of its lobes, all multiplied by the texture where there is one.

    Attributes
    ----------
    medium : Medium or None
        Where a scene has light scatter inside the shape, what leaves it is the lobes' reflectance times what the medium
        that fills it lets out; elsewhere the lobes are those of an opaque surface.
    transparency : Texture or None
        A map of how much its membranes let through, the mean of the three channels, in place of their own number, which
        is the map's mean.
    notes : tuple of str
        What a user should know of it, a line each (not reciprocal by so much, gains energy, values clamped ...).
    """

    name: str
    lobes: tuple[Lobe, ...]
    texture: Texture | None = None
    notes: tuple[str, ...] = ()
    medium: Medium | None = None
    transparency: Texture | None = None

    def __post_init__(self) -> None:
        if not self.lobes:
            raise BadInput(f"material '{self.name}' has no lobe; give it at least one.")

    @cached_property
    def key(self) -> str:
        """Content address: the lobes' parameters and the source code of their formulae, medium and maps."""
        text = [lobe.key for lobe in self.lobes] + ([self.texture.key] if self.texture else [])
        text += [repr(self.medium)] if self.medium else []
        text += ["transparency", self.transparency.key] if self.transparency else []
        return hashlib.sha256("\0".join(text).encode()).hexdigest()
