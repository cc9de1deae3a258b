"""Contact sheets: their pixels stand where and for what they are said to."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from benchmarks.studies import contact_sheet as sheets


def _read(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png)))


def test_places_without_a_point_and_broken_ones_are_told_apart() -> None:
    image = np.full((2, 2, 3), 0.5)
    image[0, 0], image[0, 1, 1] = np.nan, np.inf
    shown = sheets.exposed(image, 1.0)
    assert tuple(shown[0, 0]) == sheets.NO_POINT
    assert tuple(shown[0, 1]) == sheets.BROKEN
    assert tuple(shown[1, 1]) == (255, 255, 255)  # .5 at one stop more


def test_differences_are_blue_white_and_red() -> None:
    d = np.repeat(np.array([[-1.0, 0.0, 1.0, np.nan]])[..., None], 3, -1)
    blue, white, red, none = sheets.signed(d, 1.0)[0].astype(int)
    assert blue[2] > blue[0]
    assert red[0] > red[2]
    assert white.min() > 240
    assert tuple(none) == sheets.NO_DIFFERENCE


@pytest.mark.parametrize(("value", "end"), [(0.03, 0.05), (0.05, 0.05), (1.2, 2.0), (0.0, 0.01)])
def test_the_scale_ends_at_a_round_number(value: float, end: float) -> None:
    assert sheets.round_limit([np.full((4, 4, 3), -value)]) == pytest.approx(end)


def test_a_sheet_holds_its_tiles_and_is_the_same_twice() -> None:
    tile = np.zeros((40, 50, 3), np.uint8)
    tile[..., 1] = np.arange(40)[:, None] + 60
    rows = [[sheets.Tile(tile, "a caption that is wrapped"), None], [None, sheets.Tile(tile)]]

    def made() -> bytes:
        return sheets.compose(
            rows, columns=["first", "second"], labels=["one", "two"], notes=[sheets.toned(-0.5)],
            scale=sheets.Scale(0.2, "RMS radiances"), borders=[sheets.Border(((0, 1), (1, 1)))],
        )  # fmt: skip

    png = made()
    assert png == made()
    sheet = _read(png)
    found = [
        (y, x)
        for y, x in zip(*np.nonzero((sheet == tile[0, 0]).all(-1)), strict=True)
        if (sheet[y : y + 40, x : x + 50] == tile).all()
    ]
    (top, left), (lower, right) = found
    assert lower > top + 40
    assert right == left + 50 + sheets.GAP


def test_small_maps_are_enlarged_by_whole_steps() -> None:
    assert sheets.enlarged(np.zeros((16, 16, 3), np.uint8), 100).shape == (96, 96, 3)
    assert sheets.enlarged(np.zeros((64, 64, 3), np.uint8), 32).shape == (64, 64, 3)
