"""Dr.Jit's LLVM: where it comes from, whether it is new enough, and Mitsuba on top of it.

Everything that needs Dr.Jit or Mitsuba starts here: LLVM must be chosen before `drjit` is first imported.
"""

from __future__ import annotations

import ctypes
import importlib
import os
import sys
from pathlib import Path
from types import ModuleType

from envbench.errors import CannotRun, unknown

_VARIABLE = "DRJIT_LIBLLVM_PATH"
_WHEEL = "karellen-llvm-core"

# Mitsuba's kernels hold `fminimum` and `fmaximum`. LLVM 15 and 16 cannot lower them for x86 and end the whole process
# (`Cannot select: fminimum`) instead of raising; 17 learnt to, 19 and 20 were tried. So no trial run can ask: the
# version decides.
OLDEST = (17, 0, 0)


def find() -> str | None:
    """Point Dr.Jit at the LLVM of the environment's wheel, unless the user has chosen one.

    Cheap and idempotent. Nothing changes once `drjit` is imported, nor where no wheel is installed: Dr.Jit then looks
    for the system's LLVM by itself.

    Returns
    -------
    str or None
        The library that `DRJIT_LIBLLVM_PATH` names; None where Dr.Jit looks for itself.
    """
    if os.environ.get(_VARIABLE):
        return os.environ[_VARIABLE]
    if "drjit" in sys.modules:
        return None
    library = _library_of_wheel()
    if library is not None:
        os.environ[_VARIABLE] = library
    return library


def problem(variant: str = "llvm_ad_rgb") -> str | None:
    """Say in one line why Mitsuba's `variant` cannot run on this machine, and the remedy; None if it can.

    Raises
    ------
    CannotRun
        Dr.Jit itself cannot be imported.
    """
    drjit = _import("drjit")
    if variant.startswith("cuda") and not drjit.has_backend(drjit.JitBackend.CUDA):
        return (
            f"Mitsuba variant '{variant}': Dr.Jit finds no CUDA device; take llvm_ad_rgb, or install the NVIDIA driver."
        )
    if variant.startswith("llvm"):
        return _llvm_problem(variant, drjit)
    return None


def mitsuba(variant: str = "llvm_ad_rgb", *, fallback: bool = False) -> ModuleType:
    """Import Mitsuba with `variant` set.

    Parameters
    ----------
    variant : str
        One of Mitsuba's variants, such as "llvm_ad_rgb", "scalar_rgb", "cuda_ad_rgb".
    fallback : bool
        Where an LLVM variant cannot run, take "scalar_rgb" and say so in one line on standard error.

    Returns
    -------
    ModuleType
        The module `mitsuba`. Classes derived from Mitsuba's must be defined after this call.

    Raises
    ------
    BadInput
        Mitsuba has no such variant.
    CannotRun
        This machine lacks what the variant needs.
    """
    find()
    mi = _import("mitsuba")
    if variant not in mi.variants():
        raise unknown("Mitsuba variant", variant, mi.variants())
    reason = problem(variant)
    if reason is not None:
        if not (fallback and variant.startswith("llvm")):
            raise CannotRun(reason)
        print(f"envbench: {reason} Going on with scalar_rgb, which is slower.", file=sys.stderr)
        variant = "scalar_rgb"
    mi.set_variant(variant)
    return mi


def _library_of_wheel() -> str | None:
    from importlib import metadata

    try:
        files = metadata.files(_WHEEL) or []
    except metadata.PackageNotFoundError:
        return None
    # Besides the library itself the wheel lists links of other names to it, which an installer may have left out.
    for file in files:
        if file.name.startswith("libLLVM.so."):
            return str(Path(file.locate()).resolve())
    return None


def _llvm_problem(variant: str, drjit: ModuleType) -> str | None:
    remedy = f"Install LLVM {OLDEST[0]} or newer and set {_VARIABLE} to its libLLVM."
    if not drjit.has_backend(drjit.JitBackend.LLVM):
        where = f"at {_VARIABLE}={os.environ[_VARIABLE]}" if os.environ.get(_VARIABLE) else "on this system"
        return f"Mitsuba variant '{variant}': Dr.Jit finds no LLVM {where}. {remedy}"
    version: tuple[int, ...] = drjit.detail.llvm_version()
    if version < OLDEST:
        return f"Mitsuba variant '{variant}': LLVM {'.'.join(map(str, version))} is too old for it. {remedy}"
    return None


def _import(name: str) -> ModuleType:
    # Without libatomic `import drjit` ends in a NameError about one of its own names: look for the cause instead.
    find()
    try:
        return importlib.import_module(name)
    except (ImportError, NameError, OSError) as error:
        if sys.platform == "linux" and not _loads("libatomic.so.1"):
            raise CannotRun(
                f"{name} needs libatomic.so.1, which is missing: install libatomic1 (Debian) or libatomic (Fedora)."
            ) from error
        raise CannotRun(f"{name} cannot be imported: {error}. Install it again, e.g. with 'uv sync'.") from error


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True
