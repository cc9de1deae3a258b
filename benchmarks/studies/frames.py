"""Frames a second of the global SHRM: eq. 12 summed for a viewer into a cube map (RH 2002, sec. 7.5)."""

from __future__ import annotations

from benchmarks.studies.clock import fastest
from data_gen import environments, geometry, materials, views
from envbench import harmonics
from envbench.records import Study
from methods.shrm.whole import SHRMGlobal

FACE, IMAGE = 64, 256
MATERIALS = ("microfacet-whole", "lafortune-skin", "kajiya-kay", "cook-torrance")


def frame_rate() -> Study:
    """Return the time of a frame's map, and of the image that looks it up."""
    light = environments.build({"kind": "captured", "name": "workshop"})
    sphere = geometry.build({"kind": "sphere"}, "sphere")
    points, viewer = views.build({**views.VIEWS["image"], "size": IMAGE}, sphere, "front")
    method, runs, orders = SHRMGlobal(eps=0.03, size=FACE), {}, {}
    for name in MATERIALS:
        material = materials.build(materials.MATERIALS[name], name)
        prepared = method.prepare(material, sphere)
        relit = method.relight(prepared, light)
        framed = method.frame(relit, viewer)
        orders[name] = max(c.F for c in prepared.expansion.sums), max(c.P for c in prepared.expansion.sums)
        runs[name, "frame"] = lambda relit=relit: method.frame(relit, viewer)
        runs[name, "shade"] = lambda framed=framed: method.shade(framed, points)
    found = fastest(runs)
    rows = tuple(
        (name, *orders[name], (orders[name][1] + 1) ** 2, 1e3 * found[name, "frame"], 1 / found[name, "frame"],
         1e3 * found[name, "shade"], 1 / (found[name, "frame"] + found[name, "shade"]))
        for name in MATERIALS
    )  # fmt: skip
    return Study(
        "shrm-frame-rate",
        f"Frames a second of the global SHRM, {FACE} x {FACE} x 6",
        f"eps = .03. Map: eq. 12 for one viewer, all six faces with borders, in software, {harmonics.threads()} "
        f"threads. Image: the sphere at {IMAGE} x {IMAGE} pixels, {len(points):,} of them hit, bicubic lookup in "
        "software, where the paper's graphics hardware looks up. Fastest of rounds in turns.",
        ("material", "F", "P", "terms", "map (ms)", "maps a second", "image (ms)", "frames a second, image included"),
        rows,
    )
