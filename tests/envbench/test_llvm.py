"""Which LLVM Dr.Jit gets. Anything that imports drjit, or chooses for it, runs in a process of its own."""

from __future__ import annotations

import ctypes
import os
import platform
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from envbench import llvm
from envbench.errors import BadInput, CannotRun

wheel_only = pytest.mark.skipif(
    (sys.platform, platform.machine()) != ("linux", "x86_64"), reason="the LLVM wheel is for Linux on x86_64"
)


def fresh(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    inherited = {name: value for name, value in os.environ.items() if name != "DRJIT_LIBLLVM_PATH"}
    command = [sys.executable, "-c", code]
    return subprocess.run(command, env=inherited | environment, capture_output=True, text=True, timeout=60)


@wheel_only
def test_the_wheel_is_found_and_new_enough() -> None:
    done = fresh("from envbench import llvm; print(llvm.find()); print(llvm.find())")
    first, second = done.stdout.splitlines()
    assert first == second
    assert Path(first).is_file()
    version = [ctypes.c_uint() for _ in range(3)]
    ctypes.CDLL(first).LLVMGetVersion(*map(ctypes.byref, version))
    assert tuple(part.value for part in version) >= llvm.OLDEST


def test_the_users_choice_stands() -> None:
    done = fresh("from envbench import llvm; print(llvm.find())", DRJIT_LIBLLVM_PATH="/some/libLLVM.so")
    assert done.stdout == "/some/libLLVM.so\n"


def test_finding_imports_neither_drjit_nor_mitsuba() -> None:
    done = fresh("import sys; from envbench import llvm; llvm.find(); print({'drjit', 'mitsuba'} & set(sys.modules))")
    assert done.stdout == "set()\n"


def test_too_late_changes_nothing(monkeypatch: pytest.MonkeyPatch, mi: ModuleType) -> None:
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    assert "drjit" in sys.modules, mi
    assert llvm.find() is None


def test_mitsuba_computes(mi: ModuleType) -> None:
    assert mi.variant() == "llvm_ad_rgb"
    # An optimised kernel with the instructions that too old an LLVM cannot lower.
    assert mi.luminance(mi.Color3f(1.0))[0] == pytest.approx(1.0, abs=1e-6)


def test_an_unknown_variant_is_refused(mi: ModuleType) -> None:
    with pytest.raises(BadInput, match=r"unknown Mitsuba variant 'llvm_rgb': did you mean 'llvm_ad_rgb'\?"):
        llvm.mitsuba("llvm_rgb")


def test_cuda_without_a_device_is_one_line(mi: ModuleType) -> None:
    import drjit

    if drjit.has_backend(drjit.JitBackend.CUDA):
        pytest.skip("this machine has a CUDA device")
    with pytest.raises(CannotRun, match="finds no CUDA device; take llvm_ad_rgb") as caught:
        llvm.mitsuba("cuda_ad_rgb", fallback=True)
    assert "\n" not in str(caught.value)


def test_an_old_llvm_is_refused_by_its_version(monkeypatch: pytest.MonkeyPatch, mi: ModuleType) -> None:
    import drjit

    monkeypatch.setattr(drjit.detail, "llvm_version", lambda: (16, 0, 6))
    with pytest.raises(CannotRun, match=r"LLVM 16\.0\.6 is too old for it\. Install LLVM 17 or newer"):
        llvm.mitsuba("llvm_ad_rgb")


def test_without_llvm_the_scalar_variant_serves_if_allowed() -> None:
    code = "from envbench import llvm; print(llvm.mitsuba(fallback=True).variant())"
    done = fresh(code, DRJIT_LIBLLVM_PATH="/nonexistent/libLLVM.so")
    assert done.stdout.startswith("scalar_rgb")
    told = [line for line in done.stderr.splitlines() if line.startswith("envbench: ")]
    assert len(told) == 1
    assert "finds no LLVM at DRJIT_LIBLLVM_PATH=/nonexistent/libLLVM.so" in told[0]
    assert "Going on with scalar_rgb" in told[0]


def test_a_missing_libatomic_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(name: str) -> ModuleType:
        raise NameError("name 'ArrayBase' is not defined")

    def missing(name: str) -> None:
        raise OSError(f"{name}: cannot open shared object file")

    monkeypatch.setattr(llvm.importlib, "import_module", broken)
    monkeypatch.setattr(llvm.ctypes, "CDLL", missing)
    monkeypatch.setattr(llvm.sys, "platform", "linux")
    with pytest.raises(CannotRun, match=r"^mitsuba needs libatomic\.so\.1, which is missing: install libatomic1"):
        llvm.mitsuba()


def test_another_import_error_keeps_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(name: str) -> ModuleType:
        raise ImportError("no such symbol")

    monkeypatch.setattr(llvm.importlib, "import_module", broken)
    monkeypatch.setattr(llvm.ctypes, "CDLL", lambda name: None)
    with pytest.raises(CannotRun, match="mitsuba cannot be imported: no such symbol"):
        llvm.mitsuba()
