"""References kept on disk: one multi-part EXR each, named by the content address of all that can change the result.

Parts: the mean, its standard error, and every replicate, as float32 images of n x 1 pixels; the header holds the
provenance as JSON. The replicates alone are what is read back. A SHA-256 of all this follows as a trailer, which EXR
readers pass over: it is checked before any of them sees the file, since a damaged EXR may end the process.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import tempfile
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import data_gen.boundary
import data_gen.environments.projected
import data_gen.geometry.mitsuba_shape
import data_gen.lattice
import data_gen.mitsuba_bsdf
import data_gen.mitsuba_diffuse
import data_gen.mitsuba_estimator
import data_gen.mitsuba_light
import data_gen.mitsuba_paths
import data_gen.mitsuba_place
import data_gen.mitsuba_surface
import data_gen.mitsuba_volume
import data_gen.mitsuba_walk
import envbench.arrays
import envbench.material
import references.closed_form
import references.effects.facts
import references.effects.without
import references.estimators
import references.mitsuba_direct as direct
from envbench.reference import Reference, ReferenceSettings
from envbench.scene import Effect, Scene

SOURCES = (
    direct,
    references.estimators,
    data_gen.lattice,
    data_gen.mitsuba_diffuse,
    references.closed_form,
    references.effects.facts,
    references.effects.without,
    data_gen.boundary,
    data_gen.environments.projected,
    data_gen.geometry.mitsuba_shape,
    data_gen.mitsuba_bsdf,
    data_gen.mitsuba_estimator,
    data_gen.mitsuba_paths,
    data_gen.mitsuba_place,
    data_gen.mitsuba_surface,
    data_gen.mitsuba_light,
    data_gen.mitsuba_volume,
    data_gen.mitsuba_walk,
    envbench.arrays,
    envbench.material,
)
"""Modules whose code is part of the address; those of the lobes are in `Material.key`."""
PACKAGES = ("mitsuba", "drjit", "numpy")
_HEADER = "envbench"  # name of the header attribute
_TRAILER = b"envbench sha256 "


class Damaged(Exception):
    """A file of the cache does not hold what was written: the message says why."""


def provenance(scene: Scene, settings: ReferenceSettings) -> dict[str, Any]:
    """Return all that can change a reference, as plain JSON values."""
    return {
        "environment": scene.environment.key,
        "material": scene.material.key,
        "geometry": scene.geometry.key,
        "convex": [scene.geometry.convex, scene.geometry.posed.convex],
        "points": scene.points.key,
        "at rest": _at_rest(scene),
        "weight": _digest_of(scene.points.weight),
        "modulation": None if scene.points.modulation is None else _digest_of(scene.points.modulation),
        "uv": _digest_of(scene.points.uv) if scene.material.transparency and scene.points.uv is not None else None,
        "effects": sorted(scene.effects),
        "bounces": scene.bounces,
        "heeded": scene.heeded,
        "order": scene.order,
        "viewer": None if scene.viewer is None else repr(scene.viewer),
        **_how(scene, settings.variant),
        "settings": asdict(settings),
        "sources": {m.__name__: hashlib.sha256(inspect.getsource(m).encode()).hexdigest() for m in SOURCES},
        "versions": {name: version(name) for name in PACKAGES},
    }


def address(provenance: Mapping[str, Any]) -> str:
    """Return the content address: SHA-256 of the provenance."""
    return hashlib.sha256(json.dumps(provenance, sort_keys=True).encode()).hexdigest()


def load(folder: Path, provenance: Mapping[str, Any], scene: Scene) -> Reference | None:
    """Return the stored reference, or None where there is none.

    Raises
    ------
    Damaged
        The file does not hold what was written, or cannot be read.
    """
    import OpenEXR

    file = path(folder, address(provenance))
    if not _exists(file):
        return None
    _verify(file)
    try:
        parts = OpenEXR.File(str(file)).parts
        record = json.loads(parts[0].header[_HEADER])
        replicates = np.concatenate([p.channels["RGB"].pixels for p in parts if p.name().startswith("replicate")])
    except (RuntimeError, KeyError, ValueError, OSError) as error:
        raise Damaged(_line(error)) from error
    return Reference(
        replicates=replicates.astype(np.float64),
        weight=scene.points.weight,
        samples=record["samples"],
        seconds=record["seconds"],
        key=address(provenance),
        target=provenance["settings"]["floor"],
        from_cache=True,
        visibility_rays=record["visibility_rays"],
        notes=tuple(record["notes"]),
        provenance=record["provenance"],
    )


def store(folder: Path, reference: Reference) -> None:
    """Write a reference: the file appears whole or not at all.

    Raises
    ------
    OSError
        The folder cannot be written.
    """
    import OpenEXR

    record = {
        name: getattr(reference, name) for name in ("provenance", "samples", "seconds", "visibility_rays", "notes")
    }
    images = {"mean": reference.mean, "standard error": reference.standard_error}
    images |= {f"replicate {k}": replicate for k, replicate in enumerate(reference.replicates)}
    parts: list[Any] = []
    for name, image in images.items():
        header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        if not parts:
            header[_HEADER] = json.dumps(record)
        parts.append(OpenEXR.Part(header, {"RGB": np.ascontiguousarray(image[None], np.float32)}, name))
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".", dir=folder) as temporary:
        file = Path(temporary) / "reference.exr"
        try:
            OpenEXR.File(parts).write(str(file))
        except RuntimeError as error:  # a full disk
            raise OSError(_line(error)) from error
        digest = _digest(file.read_bytes())
        with file.open("ab") as stream:
            stream.write(_TRAILER + digest)
        file.replace(path(folder, reference.key))


def path(folder: Path, key: str) -> Path:
    """Return the file of the reference with content address `key`."""
    return folder / f"{key}.exr"


def _verify(file: Path) -> None:
    try:
        content = file.read_bytes()
    except OSError as error:
        raise Damaged(_line(error)) from error
    body, trailer, digest = content.rpartition(_TRAILER)
    if not trailer:
        raise Damaged("it is truncated")
    if digest != _digest(body):
        raise Damaged("its checksum does not fit")


def _at_rest(scene: Scene) -> list[str | None] | None:
    """Return digests of what says where the points of a posed shape are at rest; None without a pose."""
    if scene.geometry.pose is None:
        return None
    points = scene.points
    parts = (points.rotation, points.triangle, points.barycentric)
    return [None if part is None else _digest_of(part) for part in parts]


def _how(scene: Scene, variant: str) -> dict[str, Any]:
    if Effect.SUBSURFACE in scene.effects:
        most = f"at most {data_gen.mitsuba_volume.MOST_EVENTS} events"
        if references.estimators.informed(scene, variant):
            return {"integrator": f"walks, {most}", "sampler": "lattice, then independent"}
        return {"integrator": f"volpath, {most}", "sampler": data_gen.mitsuba_volume.SAMPLER}
    plain = "direct at the points, and bounces"
    sampler = data_gen.mitsuba_estimator.SAMPLER if variant.startswith("scalar") else "lattice"
    if references.estimators.informed(scene, variant) and references.closed_form.diffuse(scene.material):
        known = "closed form, and what the shape changes of it, where that is known to the floor"
        return {"integrator": f"{known}; else {plain}", "sampler": sampler}
    return {"integrator": plain, "sampler": sampler}


def _digest_of(values: NDArray[Any]) -> str:
    return hashlib.sha256(np.asarray(values, np.float64).tobytes()).hexdigest()


def _digest(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()


def _exists(file: Path) -> bool:
    try:
        return file.exists()
    except OSError as error:
        raise Damaged(_line(error)) from error


def _line(error: Exception) -> str:
    return str(error).strip().splitlines()[0]
