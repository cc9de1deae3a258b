"""What tests of every floor share: the data folder beside the checkout, and Mitsuba."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest

from envbench import llvm


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Give the folder of test data beside the checkout, which the project does not ship; skip where it is absent."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the test data of ../shared/data is not beside this checkout")
    return folder


@pytest.fixture(scope="session")
def mi() -> ModuleType:
    """Give Mitsuba in its LLVM variant."""
    return llvm.mitsuba("llvm_ad_rgb")
