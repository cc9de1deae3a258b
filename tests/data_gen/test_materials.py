"""Materials from tables: presets, refusals in one line, and what their notes say."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data_gen.lobes import Lafortune, Lambertian
from data_gen.materials import LOBES, MATERIALS, build
from envbench.errors import BadInput, NeedsData
from envbench.material import Medium

ANALYTIC = [name for name, spec in MATERIALS.items() if "lobes" in spec or spec["kind"] in (*LOBES, "translucent")]


@pytest.mark.parametrize("name", ANALYTIC)
def test_presets_build(name: str) -> None:
    material = build(MATERIALS[name], name)
    assert material.name == name
    assert material.key == build(MATERIALS[name], name).key


def test_lafortune_numbers_are_those_of_the_data_folder(shared_data: Path) -> None:
    source = tomllib.loads((shared_data / "tables" / "lafortune.toml").read_text())
    for sample, numbers in source.items():
        lobe = build({"kind": "lafortune", "sample": sample}).lobes[0]
        assert isinstance(lobe, Lafortune)
        assert list(lobe.diffuse) == numbers["rho_d"]
        for mine, theirs in (("c_xy", "cx"), ("c_xy", "cy"), ("c_z", "cz"), ("n", "n")):
            assert np.array_equal(getattr(lobe, mine), [term[theirs] for term in numbers["lobes"]])


def test_split_lafortune_scales_its_diffuse_part() -> None:
    diffuse, rest = build({"kind": "lafortune", "sample": "skin", "split": True, "reflectance": [0.5, 1, 1]}).lobes
    assert isinstance(diffuse, Lambertian)
    assert isinstance(rest, Lafortune)
    assert diffuse.reflectance == (0.428425 / 2, 0.301341, 0.331054)
    assert rest.diffuse == (0, 0, 0)


def test_notes_tell_what_gains_energy_with_the_number() -> None:
    (note,) = build(MATERIALS["lafortune-brushedmetal"]).notes
    assert "gains energy: its albedo is 1.5" in note
    assert build(MATERIALS["ggx"]).notes == ()
    assert build(MATERIALS["kajiya-kay"]).notes == ()  # no N, and so no reciprocity in the sense of rho_hat / N.L


def test_a_texture_stands_beside_kind_and_lobes() -> None:
    checker = {"kind": "checker", "squares": 4}
    for spec in ({"kind": "ggx"}, {"lobes": [{"kind": "lambertian"}, {"kind": "ggx"}]}):
        plain, textured = build(spec), build({**spec, "texture": checker})
        assert plain.texture is None
        assert textured.texture is not None
        assert textured.key != plain.key


def test_a_translucent_material_is_lambertian_with_a_medium() -> None:
    wax = build({"kind": "translucent", "mean_free_path": 0.2, "albedo": 0.9, "reflectance": [0.5, 0.4, 0.3]})
    assert wax.lobes == (Lambertian(reflectance=(0.5, 0.4, 0.3)),)
    assert wax.medium == Medium(0.2, 0.9)
    assert wax.notes == ("within is a medium of mean free path 0.2 and albedo 0.9.",)
    thick, plain = replace(wax, medium=Medium(0.1, 0.9)), replace(wax, medium=None)
    assert len({wax.key, thick.key, plain.key}) == 3


def test_a_membrane_takes_a_number_or_a_picture(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.full((4, 4, 3), 0.25, np.float32))
    mapped = build({"kind": "membrane", "transparency": str(tmp_path / "map.npy")})
    assert mapped.transparency is not None
    assert mapped.lobes == build({"kind": "membrane", "transparency": 0.25}).lobes
    assert build({"kind": "membrane", "transparency": 0.25}).transparency is None
    assert mapped.key != build({"kind": "membrane", "transparency": 0.25}).key


def test_a_measured_material_may_be_part_of_a_sum() -> None:
    with pytest.raises(NeedsData, match=r"nowhere\.binary"):
        build({"lobes": [{"kind": "lambertian"}, {"kind": "merl", "path": "nowhere.binary"}]})


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ({"kind": "fong"}, "did you mean 'phong'"),
        ({}, "unknown lobe kind"),
        ({"kind": "phong", "exponnt": 3}, "did you mean 'exponent'"),
        ({"kind": "phong", "exponent": -1}, "exponent must lie in"),
        ({"kind": "phong", "exponent": float("nan")}, "Got nan"),
        ({"kind": "phong", "exponent": "3"}, "must be a number"),
        ({"kind": "microfacet", "sigma": 0}, "sigma must lie in"),
        ({"kind": "microfacet", "sigma": float("nan")}, "Got nan"),
        ({"kind": "phong", "clipped": 1}, "must be true or false"),
        ({"kind": "phong", "reflectance": [1, 2]}, "3 numbers"),
        ({"kind": "phong", "reflectance": [1, 2, -1]}, "three finite numbers >= 0"),
        ({"lobes": []}, "no lobe"),
        ({"lobes": [{"kind": "phong"}], "clipped": True}, "beside 'lobes'"),
        ({"lobes": "phong"}, "list of tables"),
        ({"kind": "ggx", "roughness": 0}, r"GGX roughness must lie in \[0.01, 1\]. Got 0.0"),
        ({"kind": "ggx", "roughness": 1.5}, "Got 1.5"),
        ({"kind": "cook-torrance", "roughness": float("nan")}, "CookTorrance roughness .* Got nan"),
        ({"kind": "ggx", "f0": [0.5, 0.5, 1.1]}, r"f0 must be three numbers in \[0, 1\]"),
        ({"kind": "kajiya-kay", "exponent": -2}, "kajiya-kay exponent must lie in"),
        ({"kind": "kajiya-kay", "clipped": True}, "no horizon"),
        ({"kind": "lafortune", "sample": "skn"}, "did you mean 'skin'"),
        ({"kind": "lafortune", "c_xy": [[1, 1, 1]]}, "for each term. Got 1, 0 and 0"),
        ({"kind": "lafortune", "c_xy": [[1, 1, 1]], "c_z": [[1, 1, 1]], "n": [[1, 1, -1]]}, "n must lie in .* Got -1"),
        ({"kind": "lafortune", "c_xy": [1, 1, 1]}, "rows of 3 numbers"),
        ({"kind": "lafortune", "sample": "skin", "split": "yes"}, "must be true or false"),
        ({"kind": "phong", "texture": {"kind": "checkers"}}, "did you mean 'checker'"),
        ({"kind": "membrane", "transparency": {"kind": "checkers"}}, "did you mean 'checker'"),
        ({"kind": "membrane", "transparency": 1.5}, "transparency must lie in"),
        ({"kind": "membrane", "transparency": [0.5]}, "must be a number"),
        ({"kind": "translucent"}, "needs 'mean_free_path'"),
        ({"kind": "translucent", "mean_free_path": 0}, "mean_free_path must be a length > 0"),
        ({"kind": "translucent", "mean_free_path": "1"}, "must be a number"),
        ({"kind": "translucent", "mean_free_path": 1, "albedo": 1.2}, "albedo must lie in"),
        ({"kind": "translucent", "mean_free_path": 1, "albedo": 0}, "albedo must lie in"),
        ({"kind": "translucent", "mean_free_pth": 1}, "did you mean 'mean_free_path'"),
        ({"kind": "translucent", "mean_free_path": 1, "clipped": False}, "unknown setting"),
        ({"lobes": [{"kind": "translucent", "mean_free_path": 1}, {"kind": "phong"}]}, "stands by itself"),
        ({"lobes": [{"kind": "membrane", "transparency": {"kind": "checker"}}]}, "stands by itself"),
    ],
)
def test_bad_materials_say_so_in_one_line(spec: dict[str, Any], words: str) -> None:
    with pytest.raises(BadInput, match=words) as error:
        build(spec, "mine")
    assert "\n" not in str(error.value)
    assert "mine" in str(error.value)
