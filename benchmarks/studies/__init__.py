"""Studies: tables, with pictures, that belong to no scene and method. A suite asks for them by ``studies = [...]``.

A study is a function without arguments that returns an `envbench.records.Study`. To add one, write what makes it into a
file here, and register it in the file of its subject in `benchmarks.studies.listed`.
"""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.studies.listed import effects, frequency_space, reflection_maps, transfer
from envbench.records import Study

STUDIES: dict[str, Callable[[], Study]] = {
    **frequency_space.STUDIES,
    **transfer.STUDIES,
    **reflection_maps.STUDIES,
    **effects.STUDIES,
}
