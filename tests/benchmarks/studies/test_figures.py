"""Studies of figures, small: what must hold of them, whatever the pictures look like."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from benchmarks.studies import STUDIES, frequency_grid, reflection_space, rivals, view_orders
from benchmarks.studies.rendered import error, rendered, scene
from data_gen import external
from envbench.errors import NeedsData
from envbench.records import Study
from envbench.reference import Reference
from methods.shrm import SHRM

ITEMS = sorted((Path(__file__).parents[3] / "reports" / "papers").glob("*/figure-*.toml"))
VIEW = {"kind": "image", "size": 24, "direction": [0.0, -1.0, 0.0]}


def _column(study: Study, name: str) -> list[object]:
    return [row[study.columns.index(name)] for row in study.rows]


def test_the_lower_frequency_decides_at_every_sphere() -> None:
    study = frequency_grid.figure_5("grid", "workshop", "the workshop", size=32)
    assert study.judged == (45, 45)  # 25 orders, and 20 spheres off the diagonal
    assert len(study.pictures) == 1


def test_the_power_by_degree_is_that_of_the_map() -> None:
    light = scene("workshop", "lambertian", "sphere", VIEW).environment
    flat = frequency_grid._blurred(light, 2.0)
    power = frequency_grid._power(frequency_grid.harmonics.analyse(flat.radiance, frequency_grid.HIGHEST))
    weight = np.sin(np.pi * (np.arange(len(flat.radiance)) + 0.5) / len(flat.radiance))
    mean = (flat.radiance.astype(float) ** 2 * weight[:, None, None]).sum() / weight.sum() / flat.radiance.shape[1]
    assert power.sum() == pytest.approx(4 * np.pi * mean, rel=2e-3)


def test_local_views_stand_at_their_angles_to_r() -> None:
    asked = view_orders._from_view(scene("workshop", view_orders.MATERIAL, "sphere", VIEW), 140.0, 90.0).points
    assert np.allclose(np.sum(asked.reflection * asked.view, axis=1), np.cos(np.radians(140)), atol=1e-12)
    assert np.allclose(asked.view @ [0, 0, 1], np.cos(np.radians(140)) * asked.reflection[:, 2], atol=1e-12)


def test_errors_are_relative_to_the_chosen_points() -> None:
    truth = np.full((4, 3), 2.0)
    values = truth + np.array([0.2, 0.2, 1.0, 1.0])[:, None]
    reference = Reference(np.stack([truth] * 8), np.full(4, 0.25), 1, 0.0, "", 0.1)
    first = np.array([True, True, False, False])
    assert error(values, reference, first) == pytest.approx(0.1)
    assert error(values, reference) == pytest.approx(np.sqrt((0.04 + 1) / 2) / 2)


def test_a_method_is_run_through_all_its_steps() -> None:
    lit = scene("constant", "phong-whole", "sphere", VIEW)
    assert rendered(SHRM(eps=1e-3), lit) == pytest.approx(rendered(SHRM(eps=1e-3), lit).mean(), rel=1e-3)


def test_weights_and_parts_make_the_blend() -> None:
    study = reflection_space.figure_4("blend")
    assert study.judged == (2, 2)
    *weights, whole = _column(study, "weight")
    assert sum(weights) == pytest.approx(whole) == pytest.approx(1)  # type: ignore[arg-type]


def test_rivals_of_shrm_err_as_the_paper_says() -> None:
    study = rivals.figure_10("rivals", size=32)
    assert study.judged == (4, 4)


def test_what_lacks_its_data_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(external.VARIABLE, str(tmp_path))
    for name in ("rh-figure-1", "rh-figure-5", "rh-figure-7", "rh-figure-9", "cabral-figure-3"):
        with pytest.raises(NeedsData):
            STUDIES[name]()


@pytest.mark.parametrize("path", ITEMS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_items_name_studies_that_there_are(path: Path) -> None:
    item = tomllib.loads(path.read_text())
    assert {item["study"], item.get("substitute", item["study"])} <= set(STUDIES)
