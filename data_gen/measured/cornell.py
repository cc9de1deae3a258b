"""Measurements of the Cornell University Program of Computer Graphics: 31 wavelengths at scattered directions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from data_gen.measured.files import mitsuba, numbers
from data_gen.measured.table import Table
from data_gen.measured.tabulation import SHAPES, Fidelity, tabulate
from envbench.directions import Array, to_angles
from envbench.errors import BadInput

if TYPE_CHECKING:
    from scipy.spatial import KDTree

WAVELENGTHS = np.arange(400.0, 701.0, 10.0)
"""In nm."""
_NEAREST = 1e-3
_SHARPNESS = 100.0
_BLOCK = 16384


@dataclass(frozen=True)
class Scattered:
    """f between measured pairs, as pbrt-v2 interpolates it (`IrregIsotropicBRDF`).

    A pair is the point p = (sin theta_i sin theta_s, dphi / pi, cos theta_i cos theta_s), dphi in [0, pi], so that f is
    reciprocal and its own mirror image. f(q) is the mean of the samples with |p - q|^2 <= D, weighted by
    exp(-100 |p - q|^2), with D = 0.001 doubled until there are three.

    Attributes
    ----------
    points : (n, 3)
    values : (n, 3)
        Linear sRGB, 1/sr.
    zeros : float
        Share of the spectral values that are exactly 0: lost in noise.
    """

    points: Array
    values: Array
    zeros: float

    @cached_property
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree  # takes a second to import

        return KDTree(self.points)

    def __call__(self, light: Array, view: Array) -> Array:
        """Return f (n, 3) in 1/sr for directions (n, 3), N = z."""
        (theta_i, phi_i), (theta_s, phi_s) = to_angles(light), to_angles(view)
        query = pair_points(theta_i, phi_i, theta_s, phi_s)
        out = np.empty((len(query), 3))
        for start in range(0, len(query), _BLOCK):
            out[start : start + _BLOCK] = self._block(query[start : start + _BLOCK])
        return out

    def _block(self, query: Array) -> Array:
        from scipy.spatial import KDTree

        third = self._tree.query(query, k=3)[0][:, 2]
        steps = np.maximum(np.ceil(np.log2(np.maximum(third**2 / _NEAREST, 1e-9)) - 1e-9), 0)
        out = np.empty((len(query), 3))
        for step in np.unique(steps):
            chosen = np.flatnonzero(steps == step)
            reach = float(np.sqrt(_NEAREST * 2**step)) * (1 + 1e-9)
            distance = KDTree(query[chosen]).sparse_distance_matrix(self._tree, reach, output_type="coo_matrix")
            weight = distance.tocsr()
            weight.data = np.exp(-_SHARPNESS * weight.data**2)
            out[chosen] = (weight @ self.values) / np.asarray(weight.sum(1))
        return out


def pair_points(theta_i: Array, phi_i: Array, theta_s: Array, phi_s: Array) -> Array:
    """Return the points p of `Scattered`, (n, 3), for angles (n,) in radians."""
    turn = np.abs(np.mod(phi_i - phi_s + np.pi, 2 * np.pi) - np.pi)
    return np.stack([np.sin(theta_i) * np.sin(theta_s), turn / np.pi, np.cos(theta_i) * np.cos(theta_s)], -1)


def read(path: Path) -> Scattered:
    """Read a file: the number of wavelengths, the wavelengths in nm, then theta_i, phi_i, theta_s, phi_s and f.

    Raises
    ------
    BadInput
        Other wavelengths, a length that is not whole records, NaN, Inf, nothing but zeros, or a direction below N.
    """
    values = numbers(path)
    if len(values) < 32 or values[0] != 31 or not np.array_equal(values[1:32], WAVELENGTHS):
        raise BadInput(
            f"{path}: must begin with 31 and the wavelengths 400, 410 ... 700 nm; it is no such measurement."
        )
    records, rest = divmod(len(values) - 32, 35)
    if rest or records < 3:
        raise BadInput(
            f"{path}: {len(values) - 32} numbers are not whole records of 35; it is cut short, get it again."
        )
    rows = values[32:].reshape(records, 35)
    if not ((rows[:, [0, 2]] >= 0) & (rows[:, [0, 2]] <= np.pi / 2)).all():
        raise BadInput(f"{path}: a direction lies below the surface; angles must be radians from the normal.")
    if not rows[:, 4:].any():
        raise BadInput(f"{path}: reflects nothing (all zero); get it again.")
    return Scattered(pair_points(*rows[:, :4].T), rows[:, 4:] @ colours().T, float(np.mean(rows[:, 4:] == 0)))


def colours() -> Array:
    """Return what turns a spectrum at `WAVELENGTHS` into linear sRGB, (3, 31).

    Under illuminant D65, by the CIE 1931 2 degree observer; scaled so that a flat spectrum is (1, 1, 1) although
    wavelengths below 400 and above 700 nm are missing.
    """
    with mitsuba("scalar_rgb") as mi:
        observer = np.array([np.array(mi.cie1931_xyz(w)).ravel() * float(mi.cie_d65(w)) for w in WAVELENGTHS.tolist()])
        to_rgb = np.array([np.array(mi.xyz_to_srgb(mi.Color3f(*axis))).ravel() for axis in np.eye(3).tolist()]).T
    matrix = to_rgb.astype(float) @ observer.astype(float).T
    return matrix / matrix.sum(1, keepdims=True)


def table(path: Path) -> tuple[Table, Fidelity, Scattered]:
    """Tabulate the interpolation of a file, coarsely: its samples are 8 to 10 degrees apart, and it jumps."""
    scattered = read(path)
    return *tabulate(path.stem, scattered, symmetric=True, shapes=SHAPES[:1]), scattered
