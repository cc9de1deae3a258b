"""Shaded vertices as pictures: meshes rasterised off screen with pyrender through EGL, each colour as it was given.

No light is set and none is needed: a pixel is the interpolation of its triangle's three colours.
"""

from __future__ import annotations

import io
import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array, upright
from envbench.errors import CannotRun
from envbench.geometry import TriangleMesh
from envbench.machine import EGL_REMEDY

Colours = NDArray[np.uint8]
MARGIN = 1.04
"""Width of the picture over that of what it shows."""
MIME = "image/webp"
_QUALITY = 90


@dataclass(frozen=True)
class Frame:
    """What an orthographic camera sees: the middle (3,) and half the width of a square, and the depths it holds."""

    right: Array
    up: Array
    towards: Array
    centre: Array
    half: float
    depth: float

    @property
    def pose(self) -> Array:
        """Camera to world, (4, 4): x right, y up, z towards the viewer, in front of all that is seen."""
        pose = np.eye(4)
        pose[:3, :3] = np.stack([self.right, self.up, self.towards], axis=1)
        pose[:3, 3] = self.centre + 2 * self.depth * self.towards
        return pose


class Rasteriser:
    """A context of EGL that draws square pictures of `size` pixels a side.

    Raises
    ------
    CannotRun
        There is no EGL to draw with: one line that says what to install.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self._renderer = _renderer(size)

    def close(self) -> None:
        """Give the context back."""
        self._renderer.delete()

    def film(
        self,
        meshes: Sequence[TriangleMesh],
        colours: Sequence[Colours],
        direction: Sequence[float],
        up: Sequence[float],
        fps: float,
    ) -> tuple[str, bytes]:
        """Draw one picture a mesh with the colours (V, 3) of its vertices, all framed alike, and loop them.

        Parameters
        ----------
        direction, up : (3,)
            Towards the viewer, and what is upright in the pictures.
        fps : float
            Pictures a second.

        Returns
        -------
        mime, data : str, bytes
        """
        seen = framed([mesh.vertices for mesh in meshes], direction, up)
        return MIME, looped([self.draw(*pair, seen) for pair in zip(meshes, colours, strict=True)], fps)

    def draw(self, mesh: TriangleMesh, colours: Colours, seen: Frame) -> NDArray[np.uint8]:
        """Draw a mesh, (size, size, 4); alpha is 0 where nothing is."""
        import pyrender

        primitive = pyrender.Primitive(
            positions=mesh.vertices.astype(np.float32),
            indices=mesh.triangles.astype(np.uint32),
            color_0=np.column_stack([colours, np.full(len(colours), 255)]).astype(np.float32) / 255,
            material=pyrender.MetallicRoughnessMaterial(doubleSided=True),
        )
        scene = pyrender.Scene(bg_color=(0.0, 0.0, 0.0, 0.0))
        scene.add(pyrender.Mesh([primitive]))
        camera = pyrender.OrthographicCamera(seen.half, seen.half, znear=0.5 * seen.depth, zfar=3.5 * seen.depth)
        scene.add(camera, pose=seen.pose)
        flags = pyrender.RenderFlags.FLAT | pyrender.RenderFlags.RGBA
        picture: NDArray[np.uint8] = self._renderer.render(scene, flags)[0].copy()
        edge = (picture[..., 3] > 0) & (picture[..., 3] < 255)  # of several samples, those that missed count as black
        straight = np.rint(picture[edge, :3] * (255 / picture[edge, 3:]))
        picture[edge, :3] = np.minimum(straight, 255).astype(np.uint8)
        return picture


def framed(places: Sequence[Array], direction: Sequence[float], up: Sequence[float]) -> Frame:
    """Return the frame that holds all `places`, each (V, 3), seen from `direction`.

    Examples
    --------
    >>> seen = framed([np.array([[0.0, 0, 0], [2, 0, 1]]), np.array([[0.0, -4, 3]])], (0, -1, 0), (0, 0, 1))
    >>> seen.centre.tolist(), round(seen.half / MARGIN, 12)
    ([1.0, -2.0, 1.5], 1.5)
    """
    towards = np.asarray(direction, float) / np.linalg.norm(direction)
    right, above = upright(towards, up)
    axes = np.stack([right, above, towards])
    low = np.min([(vertices @ axes.T).min(0) for vertices in places], axis=0)
    high = np.max([(vertices @ axes.T).max(0) for vertices in places], axis=0)
    half = (high - low) / 2
    wide = float(max(half[0], half[1])) or 1.0
    return Frame(right, above, towards, (low + high) / 2 @ axes, MARGIN * wide, MARGIN * float(max(half[2], wide)))


def looped(pictures: Sequence[NDArray[np.uint8]], fps: float) -> bytes:
    """Encode pictures (H, W, 4) as one animated WebP that begins again when it ends."""
    from PIL import Image

    first, *others = [Image.fromarray(picture) for picture in pictures]
    buffer = io.BytesIO()
    first.save(
        buffer, "WEBP", save_all=True, append_images=others, duration=round(1000 / fps), loop=0, quality=_QUALITY
    )
    return buffer.getvalue()


def _renderer(size: int) -> Any:
    """Open an off-screen renderer; whatever EGL and its driver lack is a `CannotRun`."""
    os.environ["PYOPENGL_PLATFORM"] = "egl"  # read when PyOpenGL is imported
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pyrender and what it imports are older than what they use
            import pyrender

            return pyrender.OffscreenRenderer(size, size)
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise CannotRun(f"EGL is not usable ({reason}): {EGL_REMEDY}.") from error
