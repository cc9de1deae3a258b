"""MERL's isotropic measurements (Matusik, Pfister, Brand and McMillan 2003): a file that the user brings."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from data_gen.measured.files import size_of
from data_gen.measured.table import Table, coordinates
from data_gen.measured.tabulation import Fidelity, tabulate
from envbench.directions import Array
from envbench.errors import BadInput

SHAPE = (90, 90, 180)
"""Cells over theta_h = 90 (i / 90)^2, theta_d and phi_d, in degrees."""
SCALE = np.array([1.0, 1.15, 1.66]) / 1500
"""What turns the stored red, green and blue into 1/sr."""
_BYTES = 12 + 3 * 8 * int(np.prod(SHAPE))
_HASHES = Path(__file__).with_name("merl_sha256.txt")


@dataclass(frozen=True)
class Cells:
    """f between the centres of MERL's cells, linear; phi_d and phi_d + pi are one, since L and V may be exchanged.

    Attributes
    ----------
    values : (3, 90, 90, 182)
        In 1/sr, one more cell at either end of phi_d.
    holes : float
        Share of the cells above the horizon without a measurement (negative), filled from the next smaller theta_d.
    changed : bool
        The file bears the name of one of the 100 published ones, but is not it.
    """

    values: Array
    holes: float
    changed: bool

    def __call__(self, light: Array, view: Array) -> Array:
        """Return f (n, 3) in 1/sr for directions (n, 3), N = z."""
        t, d, p = coordinates(light.T, view.T, np.array([0.0, 0.0, 1.0]))
        c = 1 - 2 * p
        phi = np.arctan2(1 - np.abs(c), c)
        phi = np.where(np.cross(view, light)[:, 2] < 0, np.pi - phi, phi)  # -phi_d + pi
        from scipy.ndimage import map_coordinates

        where = np.stack(
            [
                90 * np.sqrt(np.arctan2(t**2, 1 - t**2) / (np.pi / 2)) - 0.5,
                90 * np.arctan2(1 - (1 - d) ** 2, (1 - d) ** 2) / (np.pi / 2) - 0.5,
                180 * phi / np.pi + 0.5,
            ]
        )
        return np.stack([map_coordinates(v, where, order=1, mode="nearest") for v in self.values], -1)


def read(path: Path) -> Cells:
    """Read a ``.binary`` file: three int32 (90, 90, 180), then float64 planes of red, green and blue.

    Raises
    ------
    BadInput
        It is of another size or resolution, holds NaN or Inf, or nothing but zeros or holes.
    """
    size = size_of(path)
    if size != _BYTES:
        raise BadInput(f"{path}: a MERL file has {_BYTES} bytes. Got {size} instead; get it again.")
    data = path.read_bytes()
    dimensions = tuple(int(n) for n in np.frombuffer(data, "<i4", 3))
    if dimensions != SHAPE:
        raise BadInput(
            f"{path}: a MERL file begins with {SHAPE}. Got {dimensions} instead; it is another kind of file."
        )
    stored = np.frombuffer(data, "<f8", offset=12).reshape(3, *SHAPE)
    if not np.isfinite(stored).all():
        raise BadInput(f"{path}: holds NaN or Inf; get it again.")
    measured = np.min(stored, axis=0) >= 0
    if not (stored[:, measured] > 0).any():
        raise BadInput(f"{path}: reflects nothing (all zero or not measured); get it again.")
    values = _filled(stored * SCALE[:, None, None, None], measured)
    values = np.concatenate([values[..., -1:], values, values[..., :1]], axis=-1)
    return Cells(values, float(np.mean(~measured[_above_horizon()])), published(path.name) not in (None, _sha256(data)))


def published(name: str) -> str | None:
    """Return the sha256 of the published file of that name, if there is one."""
    for line in _HASHES.read_text().splitlines():
        words = line.split()
        if words and words[-1] == name:
            return words[0]
    return None


def table(path: Path) -> tuple[Table, Fidelity, Cells]:
    """Tabulate a file."""
    cells = read(path)
    return *tabulate(path.stem, cells), cells


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _filled(values: Array, measured: NDArray[np.bool_]) -> Array:
    """Fill holes from the next smaller theta_d that was measured, else the next larger."""
    index = np.arange(SHAPE[1])[None, :, None]
    smaller = np.maximum.accumulate(np.where(measured, index, -1), axis=1)
    larger = np.minimum.accumulate(np.where(measured, index, SHAPE[1])[:, ::-1], axis=1)[:, ::-1]
    source = np.where(smaller >= 0, smaller, np.where(larger < SHAPE[1], larger, 0))
    filled = np.take_along_axis(values, source[None], axis=2)
    return np.where((smaller >= 0) | (larger < SHAPE[1]), filled, 0.0)


def _above_horizon() -> NDArray[np.bool_]:
    """Tell the cells whose centre has L and V above the horizon: cos theta_h > tan theta_d sin theta_h |cos phi_d|."""
    i, j, k = np.meshgrid(*(np.arange(n) + 0.5 for n in SHAPE), indexing="ij")
    theta_h, theta_d, phi_d = np.pi / 2 * (i / 90) ** 2, np.pi / 180 * j, np.pi / 180 * k
    return np.cos(theta_h) * np.cos(theta_d) > np.sin(theta_h) * np.sin(theta_d) * np.abs(np.cos(phi_d))
