"""What this machine has, what it lacks, and what to do about it. Nothing here may end the doctor itself.

Whatever could abort a process (LLVM, EGL, CUDA) is tried in one of its own.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from envbench import llvm, machine, root
from envbench.errors import CannotRun
from envbench.session import CACHE, STORE
from envbench.show import console

_VARIANT = """
import sys
from envbench import llvm
mi = llvm.mitsuba(sys.argv[1])
scene = mi.load_dict({"type": "scene", "integrator": {"type": "direct"}, "light": {"type": "constant"},
                      "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}}})
assert float(mi.TensorXf(mi.render(scene, spp=1)).array[0]) > 0
"""

_EGL = """
import pyrender
renderer = pyrender.OffscreenRenderer(8, 8)
from OpenGL.GL import GL_RENDERER, glGetString
print(glGetString(GL_RENDERER).decode())
"""

LIMIT = 60
"""Seconds that a trial in a process of its own may take."""


@dataclass(frozen=True)
class Finding:
    """One line of the table: `ok` or not, whether a run needs it, and the remedy."""

    what: str
    found: str
    ok: bool = True
    needed: bool = False
    remedy: str = ""


def run(out: Path, *, references: bool = False) -> int:
    """Print the table of findings; return 0, or 3 if something that every run needs is missing."""
    from rich.table import Table

    grid = Table("", "what", "found", "what to do", box=None, header_style="bold")
    findings = [*machine_and_versions(), *trials(), *caches(out)]
    for finding in findings:
        mark = "ok" if finding.ok else ("MISSING" if finding.needed else "absent")
        grid.add_row(mark, finding.what, finding.found, "" if finding.ok else finding.remedy)
    console().print(grid)
    missing = any(finding.needed and not finding.ok for finding in findings)
    if references and not missing:
        missing = not _references()
    return 3 if missing else 0


def machine_and_versions() -> Iterator[Finding]:
    """Yield the machine, the benchmark root, LLVM's file, and the versions of what results depend on."""
    for name, value in machine.fingerprint().items():
        if name == "memory_bytes":
            yield Finding("memory", f"{value / 2**30:.3g} GiB")
        else:
            yield Finding(name.replace("_", " "), str(value))
    try:
        yield Finding("benchmark root", str(root.find()))
    except CannotRun as error:
        yield Finding("benchmark root", "none", False, True, str(error))
    found = llvm.find()
    there = found is None or Path(found).exists()
    yield Finding("LLVM library", found or "the system's", there, True, "unset DRJIT_LIBLLVM_PATH, or mend it")
    for name, version in machine.versions().items():
        yield Finding(name, version)


def trials() -> Iterator[Finding]:
    """Yield what works when tried: Mitsuba's variants, and rendering off screen through EGL."""
    variants = {"llvm_ad_rgb": True, "scalar_rgb": False, "cuda_ad_rgb": False}
    started = {variant: _start(_VARIANT, variant) for variant in variants}
    egl = _start(_EGL, PYOPENGL_PLATFORM="egl")
    for variant, needed in variants.items():
        ok, said = _end(started[variant])
        remedy = {
            "llvm_ad_rgb": f"without it references and methods are slow or fail: {said}",
            "cuda_ad_rgb": "only for NVIDIA GPUs: install the driver to use one",
        }.get(variant, said)
        yield Finding(f"Mitsuba {variant}", "renders" if ok else "does not render", ok, needed, remedy)
    ok, said = _end(egl)
    remedy = f"only for rasterised pictures: {machine.EGL_REMEDY}"
    yield Finding("EGL (pyrender)", said if ok else f"not usable: {said}", ok, False, remedy)


def caches(out: Path) -> Iterator[Finding]:
    """Yield where things are kept, and how large they are."""
    for what, folder in (("store", out / STORE), ("references", out / CACHE), ("kernels", Path.home() / ".drjit")):
        files = [folder] if folder.is_file() else [file for file in folder.rglob("*") if file.is_file()]
        size = sum(file.stat().st_size for file in files) / 2**20
        yield Finding(f"cache of {what}" if what != "store" else what, f"{folder}: {size:.3g} MiB, files: {len(files)}")


def _start(code: str, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-W", "ignore", "-c", code, *arguments]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=os.environ | environment)


def _end(process: subprocess.Popen[str]) -> tuple[bool, str]:
    """Return whether a trial succeeded, and the last line of what it said."""
    try:
        out, err = process.communicate(timeout=LIMIT)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return False, f"no answer within {LIMIT} s"
    ok = process.returncode == 0
    lines = (out if ok else err or out).strip().splitlines()
    return ok, lines[-1] if lines else f"exit code {process.returncode}"


def _references() -> bool:
    """Print how far the two references agree on the convex scenes of `quick`; return whether they do everywhere."""
    from rich.table import Table

    from envbench import suite
    from envbench.plan import expand

    bench = root.load()
    quick = suite.read(bench.suite("quick"))
    scenes = [spec.build(bench.catalogue) for grid in quick.scenes for spec in expand(grid, quick, bench)]
    rows = bench.catalogue.agreement(scenes)
    grid = Table(
        "scene",
        "Mitsuba less quadrature",
        "99.9 % interval",
        "points outside theirs",
        "RMS difference",
        "noise floor",
        "",
    )
    for row in rows:
        numbers = (f"{row.difference:+.1e}", f"+- {row.half_width:.1e}", f"{row.outside:.1%}", f"{row.rms:.1e}")
        grid.add_row(row.scene, *numbers, f"{row.floor:.1e}", "agree" if row.agrees else "DIFFER")
    console().print(grid)
    return all(row.agrees for row in rows)
