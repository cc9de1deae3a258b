"""Studies of LDPRT that need no data: what they must say."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from benchmarks.studies import STUDIES, glyphs, varying_light, wrinkles
from envbench.directions import normalised
from envbench.real_harmonics import basis

ITEMS = Path(__file__).resolve().parents[2] / "reports" / "papers" / "sloan2005"


@pytest.mark.parametrize("name", ["zonal-random-vectors", "sh-rotation", "thin-membrane"])
def test_every_comparison_holds(name: str) -> None:
    study = STUDIES[name]()
    judged = [cell for row in study.rows for cell in row if isinstance(cell, bool)]
    assert judged
    assert all(judged)
    assert all(len(row) == len(study.columns) for row in study.rows)


def test_nodes_fitted_apart_are_nearer_at_nodes_and_farther_between(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wrinkles, "SIZE", 8)
    monkeypatch.setattr(wrinkles, "SAMPLES", 16)
    together, apart, whole = wrinkles.wrinkle_map().rows
    assert apart[1] < together[1] < 0.1  # type: ignore[operator]
    assert apart[2] > 3 * together[2]  # type: ignore[operator]
    assert whole[1] == pytest.approx(0, abs=1e-12)


def test_light_of_a_lamp_is_its_integral() -> None:
    """Over the disk of directions that it covers, by a product rule about its middle."""
    lamp = varying_light.Lamp(np.array([1.0, 2.0, 3.0]), 0.8, 5.0)
    place = np.array([[0.3, -0.2, 0.4], [1.0, 2.0, 0.0]])
    for found, p in zip(lamp.vectors(place), place, strict=True):
        away = lamp.place - p
        least = np.sqrt(1 - (lamp.radius / np.linalg.norm(away)) ** 2)
        z, weight = np.polynomial.legendre.leggauss(24)
        z, weight = (z * (1 - least) + 1 + least) / 2, weight * (1 - least) / 2
        phi = 2 * np.pi * np.arange(24) / 24
        sine = np.sqrt(1 - z * z)[:, None]
        s = np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), z[:, None]), axis=-1)
        middle = away / np.linalg.norm(away)
        side = normalised(np.cross(middle, [0.3, 0.1, 0.9]))
        turned = s @ np.stack([side, np.cross(middle, side), middle])
        y = basis(varying_light.ORDER - 1, turned.reshape(-1, 3)).reshape(-1, 24, 24)
        wanted = lamp.radiance * np.einsum("kzp,z->k", y, weight) * 2 * np.pi / 24
        assert np.allclose(found, wanted[:, None], atol=1e-12)


def test_a_glyph_is_red_above_and_blue_below() -> None:
    """Of y_10, which is positive above and negative below: as high as wide apart, and white at the borders."""
    drawn = glyphs.glyph(np.array([0, 0, 1.0, 0]), 0.5, 64).astype(int)
    redder = drawn[..., 0] > drawn[..., 2]
    coloured = (drawn != 255).any(-1)
    assert (redder & coloured)[:28].sum() == (coloured[:28]).sum() > 50
    assert (~redder & coloured)[36:].sum() == (coloured[36:]).sum() > 50
    assert not coloured[[0, -1]].any()


def test_every_item_of_the_paper_names_a_study() -> None:
    files = [path for path in ITEMS.glob("*.toml") if path.name != "paper.toml"]
    assert len(files) == 14
    for path in files:
        item = tomllib.loads(path.read_text(encoding="utf-8"))
        assert {item["study"], item.get("substitute", item["study"])} <= set(STUDIES), path.name
