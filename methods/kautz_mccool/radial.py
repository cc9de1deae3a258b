"""A radially symmetric lobe given by a table: what the angular kernel integrates for one theta_o of the 3D texture."""

from __future__ import annotations

import hashlib
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.lobes.polar import about
from envbench.arrays import dot, namespace
from envbench.material import Centre, Lobe
from methods.kautz_mccool.average import Average

Array = NDArray[np.float64]

_ENTRIES = 1024


@dataclass(frozen=True, eq=False, kw_only=True)
class AzimuthalAverage(Lobe):
    """u(theta_i) about its centre, linear between entries that are evenly spaced in sin(theta_i / 2), zero beyond them.

    Attributes
    ----------
    table : (C, n)
        Values in 1/sr; C is 1 or 3.
    end : float
        theta_i of the last entry.
    """

    table: Array
    end: float
    clipped: bool = False

    centre = Centre.NORMAL
    channels = 3

    @property
    def radially_symmetric(self) -> bool:
        return True

    @property
    def key(self) -> str:
        return super().key + hashlib.sha256(self.table.tobytes()).hexdigest()

    @classmethod
    def of(cls, average: Average, number: int) -> AzimuthalAverage:
        """Return the average at the table's view angle of that `number`."""
        end = float(average.theta[-1])
        theta = 2 * np.arcsin(np.linspace(0, np.sin(end / 2), _ENTRIES))
        values = [np.interp(theta, average.theta, channel[number]) for channel in average.values]
        return cls(table=np.stack(values), end=end)

    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        xp = namespace(light[0], centre[0])
        chord = (light[0] - centre[0], light[1] - centre[1], light[2] - centre[2])  # of length 2 sin(theta / 2)
        last = self.table.shape[1] - 1
        place = xp.sqrt(dot(chord, chord)) * (last / (2 * np.sin(self.end / 2)))
        values = tuple(xp.where(place <= last, _entry(channel, place), 0.0) for channel in self.table)
        return values * 3 if len(values) == 1 else values

    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> tuple[Any, Any, Any]:
        """Draw uniformly from the cap that holds the table."""
        xp = namespace(u[0], centre[0])
        cosine = 1 - u[0] * (1 - np.cos(self.end))
        return about(centre, cosine, xp.sqrt(xp.maximum(1 - cosine * cosine, 0.0)), 2 * np.pi * u[1])

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        xp = namespace(light[0], centre[0])
        return xp.where(dot(light, centre) >= np.cos(self.end), 1 / (2 * np.pi * (1 - np.cos(self.end))), 0.0)

    def cone(self, eps: float) -> float:
        x = np.linspace(0, np.sin(self.end / 2), self.table.shape[1])
        held = np.cumsum(np.abs(self.table).sum(0) * x)  # sin(theta) d theta = 4 x dx
        return float(2 * np.arcsin(x[np.searchsorted(held, (1 - eps) * held[-1])])) or self.end


def _entry(values: Array, place: Any) -> Any:
    """Interpolate linearly at a fractional entry; beyond the last one the result is finite and means nothing."""
    if isinstance(place, np.ndarray | float):
        return np.interp(place, np.arange(len(values)), values)
    import drjit as dr

    kinds = sys.modules[type(place).__module__]
    pairs = np.stack([values, np.append(np.diff(values), 0)], axis=1).astype(np.float32)
    entry = dr.minimum(kinds.UInt32(place), len(values) - 1)
    value, slope = dr.gather(kinds.Array2f, kinds.Float(pairs.ravel()), entry)
    return dr.fma(slope, place - dr.floor(place), value)
