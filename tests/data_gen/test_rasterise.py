"""Rasterised pictures: colours as they were given, frames alike; and without EGL a line that says what to do."""

from __future__ import annotations

import io
import sys
import types
from collections.abc import Iterator

import numpy as np
import pytest
from PIL import Image

from data_gen.rasterise import MARGIN, MIME, Rasteriser, framed, looped
from envbench.errors import CannotRun
from envbench.geometry import TriangleMesh

SIZE = 64
NORMALS = np.tile([0.0, -1.0, 0.0], (3, 1))
ONE = np.array([[0, 1, 2]], np.int32)


def triangle(shift: float = 0.0, depth: float = 0.0) -> TriangleMesh:
    """Half of the square [-1, 1] in x and z, below its diagonal, seen from -y."""
    corners = np.array([[shift - 1, depth, -1], [shift + 1, depth, -1], [shift - 1, depth, 1]])
    return TriangleMesh(corners, ONE, NORMALS)


@pytest.fixture(scope="module")
def rasteriser() -> Iterator[Rasteriser]:
    """Draw with EGL, or skip."""
    try:
        made = Rasteriser(SIZE)
    except CannotRun as error:
        pytest.skip(str(error))
    yield made
    made.close()


def test_colours_arrive_as_given_where_the_triangle_is(rasteriser: Rasteriser) -> None:
    flat = np.tile(np.array([[200, 90, 30]], np.uint8), (3, 1))
    picture = rasteriser.draw(triangle(), flat, framed([triangle().vertices], (0, -1, 0), (0, 0, 1)))
    assert (picture.shape, picture.dtype) == ((SIZE, SIZE, 4), np.uint8)
    seen = picture[..., 3] > 0  # edges too: their colour is not mixed with the ground
    assert np.abs(picture[seen, :3].astype(int) - [200, 90, 30]).max() <= 2
    assert abs(picture[..., 3].mean() / 255 - 0.5 / MARGIN**2) < 0.01
    assert picture[SIZE - 8, 8, 3] == 255  # lower left: z is upwards, x to the right
    assert picture[8, SIZE - 8, 3] == 0


def test_colours_are_linear_between_vertices(rasteriser: Rasteriser) -> None:
    colours = np.array([[0, 0, 0], [250, 0, 0], [0, 250, 0]], np.uint8)
    picture = rasteriser.draw(triangle(), colours, framed([triangle().vertices], (0, -1, 0), (0, 0, 1))).astype(int)
    row, column = np.nonzero(picture[..., 3] == 255)
    along = ((np.stack([column, SIZE - 1 - row], 1) + 0.5) / SIZE * 2 - 1) * MARGIN
    assert np.abs(picture[row, column, :2] - 125 * (1 + along)).max() < 5


def test_the_nearer_of_two_hides_the_other_from_either_side(rasteriser: Rasteriser) -> None:
    near, far = triangle(depth=-1), triangle(depth=1)
    both = TriangleMesh(
        np.concatenate([near.vertices, far.vertices]), np.concatenate([ONE, ONE + 3]), np.concatenate([NORMALS] * 2)
    )
    colours = np.repeat(np.array([[255, 0, 0], [0, 0, 255]], np.uint8), 3, axis=0)
    for direction, colour in (((0, -1, 0), [255, 0, 0]), ((0, 1, 0), [0, 0, 255])):
        picture = rasteriser.draw(both, colours, framed([both.vertices], direction, (0, 0, 1)))
        assert (picture[picture[..., 3] == 255][:, :3] == colour).all()


def test_a_film_frames_all_meshes_alike(rasteriser: Rasteriser) -> None:
    white = np.full((3, 3), 255, np.uint8)
    mime, data = rasteriser.film([triangle(), triangle(2.0)], [white] * 2, (0, -1, 0), (0, 0, 1), 5)
    film = Image.open(io.BytesIO(data))
    assert (mime, film.format, film.n_frames, film.size, film.info["loop"]) == (MIME, "WEBP", 2, (SIZE, SIZE), 0)
    middles = []
    for number in range(2):
        film.seek(number)
        middles.append(np.nonzero(np.asarray(film.convert("RGBA"))[..., 3] > 127)[1].mean())
    assert middles[1] - middles[0] == pytest.approx(SIZE / 2 / MARGIN, abs=1)


def test_a_loop_keeps_its_pace() -> None:
    film = Image.open(io.BytesIO(looped([np.full((8, 8, 4), value, np.uint8) for value in (0, 99, 255)], 8)))
    film.seek(1)
    film.load()
    assert film.info["duration"] == 125


def test_without_egl_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError("EGL: cannot open\nlibEGL.so.1")

    monkeypatch.setitem(sys.modules, "pyrender", types.SimpleNamespace(OffscreenRenderer=refuse))
    with pytest.raises(CannotRun) as told:
        Rasteriser(SIZE)
    assert str(told.value) == (
        "EGL is not usable (EGL: cannot open libEGL.so.1): "
        "apt install libegl1 libgl1-mesa-dri (dnf: mesa-libEGL mesa-dri-drivers)."
    )
