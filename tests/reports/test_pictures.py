"""Images of the report, decoded again: tone curve, difference scale, holes."""

from __future__ import annotations

import base64
import io
import math

import numpy as np
import pytest
from PIL import Image
from plotly.colors import diverging, unlabel_rgb

from reports import pictures


def decode(uri):
    head, _, body = uri.partition(",")
    assert head == "data:image/png;base64"
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(body))).convert("RGBA")).astype(int)


def flat(value, size=8):
    return np.full((size, size, 3), value, np.float32)


def test_exposure_and_srgb(make):
    # The white point (99th percentile) is 4: -2 EV. Then 1 shows as sRGB(.25), which is 137 in every table.
    image = flat(4.0)
    image[0, 0] = 1.0
    image[0, 1] = np.nan
    scene = make.scene(image=image)
    shown = pictures.gallery(0, scene, [], 1)
    pixels = decode(shown.reference)
    assert shown.exposure == -2
    assert pixels[0, 0].tolist() == [137, 137, 137, 255]
    assert pixels[1, 1].tolist() == [255, 255, 255, 255]
    assert pixels[0, 1, 3] == 0


def test_difference_is_signed_and_on_one_scale_for_all_methods(make):
    scene = make.scene(image=flat(1.0), reference_rms=2.0)
    brighter, darker = (make.cell(scene, image=flat(1 + d), settings={"d": d}) for d in (0.2, -0.1))
    shown = pictures.gallery(0, scene, [brighter, darker], 1)
    # .2 and -.1 of an RMS of 2 are 10 % and 5 %; the middle of both is 7.5 %, the next of 1-2-5 is 10 %.
    assert shown.limit == "10"
    assert shown.unit.startswith("%")
    colours = [unlabel_rgb(colour) for colour in diverging.RdBu]  # from red to blue
    red, middle = (np.array(colour) for colour in (colours[0], colours[5]))
    np.testing.assert_array_equal(decode(shown.shots[0].difference)[3, 3, :3], red)
    half = np.array(colours[7:9]).mean(0)  # -5 of -10: between the anchors at -4 and -6
    # One step of the scale, of 126 to each side, is less than 2 of 255 anywhere.
    np.testing.assert_allclose(decode(shown.shots[1].difference)[3, 3, :3], half, atol=2)
    same = pictures.gallery(0, scene, [make.cell(scene, image=flat(1.0)), brighter, darker], 1)
    np.testing.assert_array_equal(decode(same.shots[0].difference)[3, 3, :3], middle)
    assert [shot.extreme for shot in shown.shots] == ["10.0 … 10.0 %", "−5.00 … −5.00 %"]


def test_a_missing_value_is_loud_and_a_missing_point_is_not(make):
    scene = make.scene(image=make.ball(16))
    broken = scene.image.copy()
    broken[8, 8] = np.nan
    broken[8, 9, 1] = np.inf
    (shot,) = pictures.gallery(0, scene, [make.cell(scene, image=broken)], 1).shots
    assert shot.broken == 2
    for uri in (shot.render, shot.difference):
        pixels = decode(uri)
        assert pixels[8, 8].tolist() == pixels[8, 9].tolist() == [255, 0, 255, 255]
        assert pixels[0, 0, 3] == 0
        assert pixels[4, 8, 3] == 255


def test_black_reference_gives_absolute_differences(make):
    scene = make.scene(image=flat(0.0), reference_rms=0.0)
    shown = pictures.gallery(0, scene, [make.cell(scene, image=flat(0.3))], 1)
    assert shown.exposure == 0
    assert (shown.limit, shown.unit.split()[0]) == ("0.5", "W")
    assert decode(shown.reference)[0, 0].tolist() == [0, 0, 0, 255]


def test_scenes_without_points_or_images(make):
    assert pictures.gallery(0, make.scene(image=None), [], 1) is None
    empty = make.scene(image=flat(np.nan))
    (shot,) = pictures.gallery(0, empty, [make.cell(empty, image=flat(np.nan))], 1).shots
    assert (shot.broken, shot.extreme) == (0, "")
    assert pictures.gallery(0, make.scene(), [make.cell(make.scene(image=None))], 1).shots == ()


@pytest.mark.parametrize(("count", "side", "step"), [(0, 0, 1), (500, 128, 1), (500, 512, 4), (1, 8192, 3)])
def test_thinning_keeps_the_page_within_its_pixels(count, side, step):
    images = [np.broadcast_to(np.float32(0), (side, side, 3))] * count
    assert pictures.thinning(images) == step
    assert 2 * count * math.ceil(side / step) ** 2 <= pictures.PIXEL_BUDGET
