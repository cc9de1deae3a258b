"""Linear blend skinning: a vertex goes where the weighted mean of its bones' affine transforms takes it.

v' = sum_b w_b (A_b v + a_b). The weights' own gradients are left out, as is usual: F = sum_b w_b A_b, and the normal is
that of sum_b w_b cof(A_b) n, which for rigid bones is the mean of the turned normals.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from data_gen.external import locate
from data_gen.geometry import parameters as p
from data_gen.geometry.frames import cofactors
from envbench.directions import Array, normalised
from envbench.errors import BadInput

WEIGHT_SUM = 1e-3
"""How far the weights of a vertex may sum from 1; within this they are scaled to it."""

Arrays = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, kw_only=True)
class Skin:
    """The skeleton of an .npz at a `time` in [0, 1] of its keys, at a `frame` of its sequence, or at `transforms`.

    `transforms` gives each bone a 3 x 4 matrix, or 12 numbers row by row. Between keys and frames rotations are
    interpolated on the sphere (slerp) and translations linearly, transforms that are not rigid entry by entry. `path`
    names another file than the mesh's own.
    """

    kind: ClassVar[str] = "skin"

    time: float | None = None
    frame: float | None = None
    transforms: Any = None
    path: Any = None

    def __post_init__(self) -> None:
        if sum(value is not None for value in (self.time, self.frame, self.transforms)) != 1:
            raise BadInput("a skin pose has a time, a frame or transforms; give exactly one of them.")
        if self.time is not None:
            p.number("time", self.time, 0, 1)
        if self.frame is not None:
            p.number("frame", self.frame, 0, 1e6)
        if self.path is not None:
            p.path("path", self.path)

    def at(self, file: Path | None, count: int, kept: NDArray[np.int_], x: Array, n: Array) -> tuple[Array, ...]:
        """Return posed places (V, 3), the gradients F (V, 3, 3), and posed normals (V, 3).

        `kept` are the vertices x, with normals n, among the `count` of the file; all in the axes of the file.
        """
        source = file if self.path is None else locate(self.path)
        if source is None or source.suffix.lower() != ".npz":
            raise BadInput("a skin pose needs the arrays of an .npz file; give its path.")
        arrays = _arrays(source)
        slots = _slots(arrays, source.name, count)
        bones = self._bones(arrays, source.name)
        summed = np.zeros((len(kept), 3, 4))
        normal = np.zeros_like(n)
        turn = cofactors(bones[:, :, :3])
        for index, weight in slots:  # by slot: memory of one matrix a vertex
            if int(index.max()) >= len(bones):
                raise BadInput(f"bone {index.max()} of a vertex in '{source.name}' is not one of {len(bones)}.")
            index, weight = index[kept], weight[kept]
            used = weight != 0
            summed[used] += weight[used, None, None] * bones[index[used]]
            normal[used] += weight[used, None] * np.einsum("nij,nj->ni", turn[index[used]], n[used])
        F = summed[:, :, :3]
        return np.einsum("nij,nj->ni", F, x) + summed[:, :, 3], F, normalised(normal)

    def _bones(self, arrays: Arrays, name: str) -> Array:
        """Return the skinning transforms (B, 3, 4)."""
        if self.transforms is not None:
            given: Any = self.transforms
            flat = p.array("transforms", [np.ravel(bone) for bone in given] if isinstance(given, list) else given,
                           (None, 12))  # fmt: skip
            dense = arrays["skin_weights"].shape[1] if "skin_indices" not in arrays else len(flat)
            if len(flat) != dense:
                raise BadInput(f"transforms are for {len(flat)} handles; '{name}' has {dense}.")
            return flat.reshape(-1, 3, 4)
        if self.frame is not None:
            frames = _named(arrays, "key_transforms", name, "frame", "give transforms or a time")
            if self.frame > len(frames) - 1:
                raise BadInput(f"frame must be at most {len(frames) - 1} in '{name}'. Got {self.frame!r} instead.")
            return _between(frames.astype(float), np.arange(float(len(frames))), self.frame)
        keys = _named(arrays, "key_local", name, "time", "give a frame or transforms").astype(float)
        times = np.asarray(arrays["key_times"], float)
        local = _between(keys[:, :, :3], times, times[0] + float(self.time or 0) * (times[-1] - times[0]))
        below = np.tile([0.0, 0.0, 0.0, 1.0], (len(local), 1, 1))
        local = np.concatenate([local, below], axis=1)
        world: list[Array] = []
        for parent, own in zip(arrays["bone_parents"], local, strict=True):  # a parent comes before its children
            world.append(own if parent < 0 else world[int(parent)] @ own)
        return (np.stack(world) @ arrays["bone_offset"].astype(float))[:, :3]


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    names = ("skin_weights", "skin_indices", "key_transforms", "key_local", "key_times", "bone_parents", "bone_offset")
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in names if name in file}
    except Exception as error:  # a damaged zip, or arrays of objects
        raise BadInput(f"'{path}' cannot be read as .npz arrays; write it again.") from error
    if "skin_weights" not in arrays:
        raise BadInput(f"'{path.name}' has no array skin_weights, so it has no skin pose.")
    return arrays


def _named(arrays: Arrays, array: str, file: str, setting: str, instead: str) -> NDArray[Any]:
    if array not in arrays:
        raise BadInput(f"'{file}' has no array {array} to take a {setting} of; {instead}.")
    return arrays[array]


def _slots(arrays: Arrays, file: str, count: int) -> list[tuple[NDArray[np.int_], Array]]:
    """Return bone and weight of every vertex, slot by slot, checked."""
    weights = arrays["skin_weights"].astype(float)
    if weights.ndim != 2 or len(weights) != count:
        raise BadInput(f"skin_weights of '{file}' are for {len(weights)} vertices; this mesh has {count}.")
    if "skin_indices" in arrays:
        indices = np.asarray(arrays["skin_indices"], int)
        if indices.shape != weights.shape or indices.min() < 0:
            raise BadInput(
                f"skin_indices of '{file}' must be bones (from 0) in the shape {weights.shape} of the weights."
            )
    else:
        indices = np.broadcast_to(np.arange(weights.shape[1]), weights.shape)
    total = weights.sum(1)
    wrong = ~(np.abs(total - 1) <= WEIGHT_SUM)  # NaN too
    if wrong.any():
        vertex = int(np.flatnonzero(wrong)[0])
        raise BadInput(
            f"skin weights of vertex {vertex} in '{file}' sum to {total[vertex]:.4g}, not 1: normalise them."
        )
    if weights.min() < -WEIGHT_SUM:
        raise BadInput(f"skin weights of '{file}' reach {weights.min():.3g}; they must not be negative.")
    return [(indices[:, k], weights[:, k] / total) for k in range(weights.shape[1])]


def _rigid(transforms: Array) -> bool:
    """Tell whether the matrices of transforms (B, 3, 4) are rotations, to single precision."""
    A = transforms[:, :, :3]
    return bool(np.abs(A @ A.swapaxes(1, 2) - np.eye(3)).max() < 1e-3 and (np.linalg.det(A) > 0).all())


def _between(keys: Array, times: Array, time: float) -> Array:
    """Return the transforms (B, 3, 4) at a time between keys (K, B, 3, 4)."""
    from scipy.spatial.transform import Rotation

    after = int(np.clip(np.searchsorted(times, time), 1, max(len(times) - 1, 1)))
    if len(times) == 1 or time == times[after]:
        return keys[min(after, len(times) - 1)]
    if time == times[after - 1]:
        return keys[after - 1]
    first, last = keys[after - 1], keys[after]
    share = (time - times[after - 1]) / (times[after] - times[after - 1])
    if not all(_rigid(key) for key in (first, last)):
        return (1 - share) * first + share * last
    start, end = Rotation.from_matrix(first[:, :, :3]), Rotation.from_matrix(last[:, :, :3])
    turned = start * Rotation.from_rotvec(share * (start.inv() * end).as_rotvec())
    place = (1 - share) * first[:, :, 3] + share * last[:, :, 3]
    return np.concatenate([turned.as_matrix(), place[:, :, None]], axis=2)
