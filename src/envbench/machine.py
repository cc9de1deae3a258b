"""Where a run took place: the machine, and the versions of all that can change a number."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any

from envbench import llvm

_COMPUTE = ("numpy", "scipy", "mitsuba", "drjit", "ducc0", "openexr", "scikit-image", "trimesh")

EGL_REMEDY = "apt install libegl1 libgl1-mesa-dri (dnf: mesa-libEGL mesa-dri-drivers)"
"""What lets pyrender rasterise off screen where it cannot."""


def fingerprint() -> dict[str, Any]:
    """Return the machine as timings depend on it: JSON values, read without starting anything heavy."""
    import psutil

    return {
        "cpu": _cpu(),
        "cores": psutil.cpu_count(logical=False),
        "logical_cores": psutil.cpu_count(),
        "usable_cores": len(psutil.Process().cpu_affinity()) if hasattr(psutil.Process, "cpu_affinity") else None,
        "memory_bytes": psutil.virtual_memory().total,
        "os": platform.platform(),
        "python": platform.python_version(),
        "ci": os.environ.get("CI", "").lower() not in ("", "0", "false"),
    }


def versions() -> dict[str, str]:
    """Return the versions of envbench (with its commit where it runs from a checkout), its libraries and LLVM."""
    found = {"envbench": " ".join(filter(None, (metadata.version("envbench"), _commit())))}
    for name in _COMPUTE:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    library = llvm.find()
    return found | {"llvm": Path(library).name if library else "the system's"}


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _commit() -> str:
    """Return "(git 0123456789ab)", with "-dirty" where files were changed; nothing outside envbench's own checkout."""
    package = Path(__file__).resolve().parent

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", package, *words], capture_output=True, text=True, check=True, timeout=10)
        return done.stdout.strip()

    try:
        if Path(git("rev-parse", "--show-toplevel")) / "src" / "envbench" != package:
            return ""
        return f"(git {git('describe', '--always', '--dirty', '--abbrev=12', '--exclude=*')})"
    except (OSError, subprocess.SubprocessError):
        return ""
