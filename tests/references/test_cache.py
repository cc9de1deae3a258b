"""The cache: the same bits back, every ingredient in the address, damage found and mended."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from data_gen.lobes import Lambertian, Phong
from envbench.environment import Environment
from envbench.geometry import Geometry
from envbench.material import Material
from envbench.reference import Reference, ReferenceSettings
from envbench.scene import Effect, Scene
from references import cache, reference

MakeScene = Callable[..., Scene]
SETTINGS = ReferenceSettings(floor=0.2)


@pytest.fixture
def scene(mi: ModuleType, make_scene: MakeScene, lit: Environment) -> Scene:
    return make_scene(lit, Lambertian(), count=5)


def only_file(folder: Path) -> Path:
    (file,) = folder.iterdir()
    return file


def test_stored_and_fresh_are_the_same_bits(scene: Scene, tmp_path: Path) -> None:
    fresh, stored = (reference(scene, SETTINGS, tmp_path / "new" / "folder") for _ in range(2))
    assert not fresh.from_cache
    assert stored.from_cache
    assert np.array_equal(fresh.replicates, stored.replicates)
    for name in ("samples", "seconds", "key", "target", "visibility_rays", "notes"):
        assert getattr(fresh, name) == getattr(stored, name), name
    assert fresh.provenance == stored.provenance
    assert stored.key == only_file(tmp_path / "new" / "folder").stem


def test_file_holds_mean_error_and_replicates(scene: Scene, tmp_path: Path) -> None:
    import OpenEXR

    made = reference(scene, SETTINGS, tmp_path)
    parts = OpenEXR.File(str(only_file(tmp_path))).parts
    assert [p.name() for p in parts] == ["mean", "standard error", *(f"replicate {k}" for k in range(8))]
    assert parts[0].channels["RGB"].pixels[0] == pytest.approx(made.mean, rel=1e-6)
    assert parts[1].channels["RGB"].pixels[0] == pytest.approx(made.standard_error, rel=1e-6)


@pytest.mark.parametrize("kept", [0, 1, 100, 0.1, 0.5, 0.9, -70, -1], ids=str)
def test_a_truncated_file_is_recomputed(scene: Scene, tmp_path: Path, kept: float) -> None:
    first = reference(scene, SETTINGS, tmp_path)
    file = only_file(tmp_path)
    content = file.read_bytes()
    file.write_bytes(content[: int(kept * len(content)) if isinstance(kept, float) else kept])
    assert_mended(scene, tmp_path, first)


@pytest.mark.parametrize("place", [0.0, 0.03, 0.4, 0.8, 0.999])
def test_a_flipped_bit_is_found(scene: Scene, tmp_path: Path, place: float) -> None:
    first = reference(scene, SETTINGS, tmp_path)
    file = only_file(tmp_path)
    content = bytearray(file.read_bytes())
    content[int(place * len(content))] ^= 4
    file.write_bytes(content)
    assert_mended(scene, tmp_path, first)


def assert_mended(scene: Scene, folder: Path, first: Reference) -> None:
    again = reference(scene, SETTINGS, folder)
    assert not again.from_cache
    assert again.notes[:-1] == first.notes
    assert "was damaged" in again.notes[-1]
    assert "recomputed" in again.notes[-1]
    assert np.array_equal(again.replicates, first.replicates)
    stored = reference(scene, SETTINGS, folder)
    assert stored.from_cache
    assert stored.notes == first.notes


def test_an_unwritable_folder_is_said_and_stops_nothing(scene: Scene, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    result = reference(scene, SETTINGS, blocked / "folder")
    assert result.mean.any()
    assert any("not kept" in note for note in result.notes)


def test_no_cache_leaves_nothing(scene: Scene) -> None:
    assert not any("cache" in note for note in reference(scene, SETTINGS, None).notes)


def test_every_ingredient_changes_the_address(
    make_scene: MakeScene, lit: Environment, monkeypatch: pytest.MonkeyPatch
) -> None:
    def address(scene: Scene, settings: ReferenceSettings = SETTINGS) -> str:
        return cache.address(cache.provenance(scene, settings))

    scene = make_scene(lit, Lambertian(), count=5)
    brighter = Environment("rough", lit.radiance * np.float32(1.0001))
    addresses = [
        address(scene),
        address(replace(scene, environment=brighter)),
        address(replace(scene, material=Material("test", (Phong(),)))),
        address(replace(scene, material=Material("test", (Lambertian(clipped=False),)))),
        address(replace(scene, geometry=Geometry("sphere", convex=False))),
        address(make_scene(lit, Lambertian(), count=5, seed=1)),
        address(replace(scene, points=replace(scene.points, weight=np.array([0.6, 0.1, 0.1, 0.1, 0.1])))),
        address(replace(scene, effects=frozenset({Effect.SELF_SHADOWING}))),
        address(scene, ReferenceSettings(floor=0.1)),
        address(scene, ReferenceSettings(floor=0.2, budget=10)),
        address(scene, ReferenceSettings(floor=0.2, replicates=9)),
        address(scene, ReferenceSettings(floor=0.2, seed=1)),
        address(scene, ReferenceSettings(floor=0.2, variant="scalar_rgb")),
    ]
    for module in cache.SOURCES:
        with monkeypatch.context() as patch:
            patch.setattr(cache.inspect, "getsource", lambda m, changed=module: "new" if m is changed else "old")
            addresses.append(cache.address(cache.provenance(scene, SETTINGS)["sources"]))
    for package in cache.PACKAGES:
        with monkeypatch.context() as patch:
            patch.setattr(cache, "version", lambda name, changed=package: "2" if name == changed else "1")
            addresses.append(address(scene))
    assert len(set(addresses)) == len(addresses)
    assert address(replace(scene, name="another", environment=replace(lit, name="another"))) == addresses[0]
