"""Neural BRDFs: small networks fitted to MERL materials (Sztrajman, Rainer, Ritschel and Weyrich, CGF 2021)."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from data_gen.measured.table import Table
from data_gen.measured.tabulation import Fidelity, tabulate
from envbench.directions import Array
from envbench.errors import BadInput, unknown

_SIZES = {"W1": (6, 21), "b1": (21,), "W2": (21, 21), "b2": (21,), "W3": (21, 3), "b3": (3,)}
_BLOCK = 4096
"""Pairs at a time: the layers stay in the processor's cache."""


@dataclass(frozen=True)
class Network:
    """f = max(0, exp(y) - 1), y = relu(relu(x W1 + b1) W2 + b2) W3 + b3.

    x = (sin theta_h, 0, cos theta_h, d): H turned to azimuth 0, and d = L as seen from a frame with H along z.
    """

    weights: dict[str, NDArray[np.float32]]

    def __call__(self, light: Array, view: Array) -> Array:
        """Return f (n, 3) in 1/sr for directions (n, 3), N = z."""
        pairs = np.stack([light.T, view.T]).astype(np.float32)  # as the network was trained
        blocks = np.split(pairs, np.arange(_BLOCK, len(light), _BLOCK), axis=-1)
        return np.concatenate([self._block(*block) for block in blocks])

    def _block(self, light: NDArray[np.float32], view: NDArray[np.float32]) -> Array:
        w = self.weights
        h = light + view
        h /= np.sqrt((h * h).sum(0))
        sine = np.hypot(h[0], h[1])
        along, across = np.where(sine > 0, h[:2] / np.where(sine > 0, sine, 1), [[1], [0]])
        x = along * light[0] + across * light[1]
        y = along * light[1] - across * light[0]
        d = (h[2] * x - sine * light[2], y, sine * x + h[2] * light[2])
        a = np.stack([sine, np.zeros_like(sine), h[2], *d], -1)
        a = np.maximum(a @ w["W1"] + w["b1"], 0)
        a = np.maximum(a @ w["W2"] + w["b2"], 0)
        return np.maximum(np.expm1(a @ w["W3"] + w["b3"]), 0).astype(float)


def read(path: Path, material: str) -> Network:
    """Read one material's weights from an archive of all.

    Raises
    ------
    BadInput
        The file is no such archive, lacks an array, or holds other shapes, NaN or Inf; or has no such material.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {key: archive[key] for key in ("names", *_SIZES)}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise BadInput(f"{path}: no archive of neural BRDFs ({error}); expected names, {', '.join(_SIZES)}.") from error
    names = [str(name) for name in arrays["names"].ravel()]
    for key, size in _SIZES.items():
        if arrays[key].shape != (len(names), *size):
            raise BadInput(f"{path}: {key} must have shape {(len(names), *size)}. Got {arrays[key].shape} instead.")
    if material not in names:
        raise unknown(f"material of {path.name}", material, names)
    weights = {key: arrays[key][names.index(material)].astype(np.float32) for key in _SIZES}
    if not all(np.isfinite(value).all() for value in weights.values()):
        raise BadInput(f"{path}: the weights of '{material}' hold NaN or Inf; get the file again.")
    return Network(weights)


def table(path: Path, material: str) -> tuple[Table, Fidelity]:
    """Tabulate one material."""
    return tabulate(material, read(path, material))
