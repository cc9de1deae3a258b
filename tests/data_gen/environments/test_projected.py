"""Projected light: its coefficients, its windows, and what its notes say of ringing and negative energy."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from data_gen.environments import build
from data_gen.environments.projected import negative_share, project
from envbench import latlong, real_harmonics
from envbench.directions import uniform
from envbench.environment import Environment
from envbench.errors import BadInput


@pytest.mark.parametrize("order", [1, 3, 4, 6])
def test_holds_the_lights_own_coefficients_and_no_others(order: int) -> None:
    light = build({"kind": "captured", "name": "esplanade", "size": 64})
    made = project(light, order)
    assert made.signed
    exact = real_harmonics.project(light.radiance.astype(float), order - 1)
    got = real_harmonics.project(made.radiance.astype(float), order + 2)
    scale = np.sqrt((exact**2).sum())
    assert got[: order**2] == pytest.approx(exact, abs=1e-6 * scale)
    assert np.sqrt((got[order**2 :] ** 2).sum()) < 1e-3 * scale


def test_the_note_states_what_interpolation_misses() -> None:
    light = build({"kind": "lamps", "seed": 1})
    made = project(light, 6)
    where = uniform(5000, np.random.default_rng(0))
    exact = real_harmonics.basis(5, where).T @ real_harmonics.project(light.radiance.astype(float), 5)
    off = np.sqrt(((made(where) - exact) ** 2).mean() / (exact**2).mean())
    stated = float(re.search(r"by ([\d.e+-]+) RMS", made.notes[-1])[1])  # pyright: ignore[reportOptionalSubscript]
    assert off == pytest.approx(stated, rel=0.15)
    assert stated < 3e-4


def test_windows_damp_the_upper_bands_and_the_ringing() -> None:
    light = build({"kind": "lamps", "lamps": [{"direction": [1, 1, 1], "width": 0.05, "radiance": 100.0}]})
    shares = [negative_share(project(light, 6, name).radiance)[1] for name in ("none", "lanczos", "hanning")]
    assert shares[0] > shares[1] > shares[2]
    full, damped = (real_harmonics.project(project(light, 6, name).radiance, 5) for name in ("none", "lanczos"))
    band = np.repeat(np.arange(6), 2 * np.arange(6) + 1)
    assert damped == pytest.approx(full * np.sinc(band / 6)[:, None], abs=1e-4 * np.abs(full).max())


def test_negative_energy_of_a_known_light() -> None:
    """1 + 2 z is negative for z < -1/2, a quarter of the sphere; its square there has the integral 1/6, of 14/3."""
    z = latlong.grid(256, 512)[..., 2:]
    covered, share = negative_share(np.broadcast_to(1 + 2 * z, (256, 512, 3)))
    assert covered == pytest.approx(0.25, abs=2e-3)
    assert share == pytest.approx((1 / 6) / (14 / 3), rel=1e-2)


def test_from_tables_and_names() -> None:
    by_name, by_table = (
        build({"kind": "projected", "order": 3, "size": 32, **source})
        for source in ({"of": "studio"}, {"light": {"kind": "captured", "name": "studio"}})
    )
    assert by_name.key == by_table.key
    assert any("negative on" in note for note in by_name.notes)
    assert build({"kind": "projected", "of": "studio", "scale": 2.0, "order": 3, "size": 32}).radiance == pytest.approx(
        2 * by_name.radiance
    )


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({}, "exactly one"),
        ({"of": "studio", "light": {"kind": "constant"}}, "exactly one"),
        ({"of": "studoi"}, "did you mean 'studio'"),
        ({"light": 3}, "must be a table"),
        ({"of": "constant", "order": 0}, "order"),
        ({"of": "constant", "order": 65}, "order"),
        ({"of": "constant", "window": "hamming"}, "hanning"),
        ({"of": "constant", "size": 8}, ">= 2 x order"),
    ],
)
def test_refuses(settings: dict[str, Any], named: str) -> None:
    with pytest.raises(BadInput, match=named):
        build({"kind": "projected", **settings})


def test_negative_radiance_is_refused_where_it_is_not_said() -> None:
    values = np.full((4, 8, 3), -1, np.float32)
    with pytest.raises(BadInput, match="negative radiance"):
        Environment("dark", values)
    light = Environment("signed", values, signed=True)
    assert [(sign, part.radiance.max()) for sign, part in light.parts] == [(-1.0, 1.0)]
    assert Environment("black", 0 * values).parts == ()
