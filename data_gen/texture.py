"""Textures that modulate reflectance: read from files or generated, and looked up at points."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.environments.exr import read_exr
from data_gen.external import locate
from envbench.directions import Array
from envbench.errors import BadInput, unknown
from envbench.geometry import Points
from envbench.material import Texture

MAX_PIXELS = 8192 * 8192


def build(spec: str | Mapping[str, Any], name: str = "texture") -> Texture:
    """Make a texture from the path of a picture, or from a table.

    ``{"kind": "file", "path": ...}`` reads a picture (`read`). ``{"kind": "checker", "squares": 8, "colours": [a, b]}``
    alternates two colours over `squares` x `squares` squares, and ``{"kind": "gradient", "colours": [a, b]}`` goes from
    one to the other with v. A colour is three numbers in [0, 1].

    Raises
    ------
    BadInput
        For an unknown kind or key, a value out of range, or a file that is no picture.

    Examples
    --------
    >>> build({"kind": "checker", "squares": 2, "colours": [[0, 0, 0], [1, 1, 1]]}).values[:, :, 0].tolist()
    [[0.0, 1.0], [1.0, 0.0]]
    """
    table: Any = {"kind": "file", "path": spec} if isinstance(spec, str) else spec
    if not isinstance(table, Mapping):
        raise BadInput(f"texture of '{name}' must be the path of a picture, or a table. Got {spec!r} instead.")
    keys = {"file": {"path"}, "checker": {"squares", "colours"}, "gradient": {"colours"}}
    kind = str(table.get("kind"))
    if kind not in keys:
        raise unknown(f"kind of texture of '{name}':", kind, keys)
    for key in {str(key) for key in table} - {"kind"} - keys[kind]:
        raise unknown(f"setting of the {kind} texture of '{name}':", key, keys[kind])
    if kind == "file":
        return read(str(table.get("path")))
    low, high = _colours(table.get("colours", ((0.1, 0.1, 0.1), (0.9, 0.9, 0.9))), name)
    if kind == "gradient":
        mix = np.linspace(0, 1, 256)[:, None, None]
    else:
        squares = table.get("squares", 8)
        if isinstance(squares, bool) or not isinstance(squares, int) or not 1 <= squares <= 4096:
            raise BadInput(f"texture of '{name}': squares must be an int in [1, 4096]. Got {squares!r} instead.")
        mix = (np.indices((squares, squares)).sum(0) % 2)[..., None]
    return Texture(kind, (low + mix * (high - low)).astype(np.float32))


def read(path: str | Path) -> Texture:
    """Read a picture, at `path` or in the data folder.

    ``.png``, ``.jpg`` and ``.jpeg`` hold sRGB, which is decoded to linear (IEC 61966-2-1); ``.exr`` and ``.npy``
    (floats, (H, W, 3)) are linear already. Grey becomes three equal channels; opacity is ignored.

    Raises
    ------
    BadInput
        For a file that is missing (`NeedsData`), damaged or of another kind, or values outside [0, 1], NaN included.
    """
    path = locate(path)
    match path.suffix.lower():
        case ".png" | ".jpg" | ".jpeg":
            values = _linear(_picture(path))
        case ".exr":
            values = read_exr(path, lambda width, height: _check_size(path, width, height))[0]
        case ".npy":
            values = _array(path)
        case suffix:
            raise BadInput(f"{path}: suffix '{suffix}' is no texture's; convert it to .png, .jpg, .exr or .npy.")
    _check_size(path, values.shape[1], values.shape[0])
    low, high = float(values.min()), float(values.max())
    if not (low >= 0 and high <= 1):
        raise BadInput(f"{path}: values from {low:g} to {high:g}; a texture lies in [0, 1]: scale or clamp it.")
    return Texture(path.stem, np.ascontiguousarray(values, np.float32))


def modulation(texture: Texture, points: Points) -> Array:
    """Return the texture at the points' uv, (n, 3)."""
    return looked_up(texture, points.uv)


def transparency(map_: Texture, uv: Array | None) -> Array:
    """Return the transparency that a map has at uv (n, 2), (n,): the mean of its channels."""
    return looked_up(map_, uv).mean(axis=1)


def looked_up(texture: Texture, uv: Array | None) -> Array:
    """Return the texture at uv (n, 2), (n, 3): bilinear between texels, repeating beyond [0, 1].

    Raises
    ------
    BadInput
        There are no uv.
    """
    if uv is None:
        raise BadInput(
            f"texture '{texture.name}' needs points with uv, and the shape's mesh has none; unwrap it first."
        )
    height, width = texture.values.shape[:2]
    x, y = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - column)[:, None], (y - row)[:, None]
    near, far = row % height, (row + 1) % height
    left, right = column % width, (column + 1) % width
    values = texture.values.astype(float)
    upper = (1 - fx) * values[near, left] + fx * values[near, right]
    return (1 - fy) * upper + fy * ((1 - fx) * values[far, left] + fx * values[far, right])


def _picture(path: Path) -> Array:
    """Return a picture of integers as (H, W, 3) in [0, 1]."""
    from skimage import io

    try:
        pixels: NDArray[np.generic] = io.imread(path)
    except Exception as error:  # whatever the decoder of the day raises
        raise BadInput(f"{path}: truncated, damaged or no picture; export it again.") from error
    if pixels.dtype.kind != "u" or pixels.ndim not in (2, 3):
        raise BadInput(f"{path}: shape {pixels.shape}, dtype {pixels.dtype}; 8 or 16 bits a channel are needed.")
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels
    pixels = pixels[..., :3] if pixels.shape[2] >= 3 else pixels[..., :1]
    scaled = pixels.astype(float) / (256**pixels.itemsize - 1)
    return np.broadcast_to(scaled, (*scaled.shape[:2], 3))


def _linear(encoded: Array) -> Array:
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def _array(path: Path) -> NDArray[Any]:
    try:
        values: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # ValueError, EOFError, SyntaxError in a damaged header ...
        raise BadInput(f"{path}: truncated, damaged or not a plain .npy array; save it again.") from error
    if values.ndim != 3 or values.shape[2] != 3 or values.dtype.kind != "f" or not values.size:
        raise BadInput(
            f"{path}: shape {values.shape}, dtype {values.dtype}; a float array (height, width, 3) is needed."
        )
    return values


def _check_size(path: Path, width: int, height: int) -> None:
    if width * height > MAX_PIXELS:
        raise BadInput(f"{path}: {width} x {height} pixels; at most 8192 x 8192 are read: reduce it first.")


def _colours(value: Any, name: str) -> tuple[Array, Array]:
    try:
        colours = np.array(value, float)
    except (TypeError, ValueError):
        colours = np.zeros(0)
    if colours.shape != (2, 3) or not ((colours >= 0) & (colours <= 1)).all():
        raise BadInput(f"texture of '{name}': colours must be two of three numbers in [0, 1]. Got {value!r} instead.")
    return colours[0], colours[1]
