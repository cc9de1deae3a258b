"""Animations: each a looped picture as a data URI, or why there is none."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass

from envbench.records import Film


@dataclass(frozen=True)
class Reel:
    """A film, and its picture as a data URI; none where it has a reason instead."""

    film: Film
    uri: str


def reels(films: Sequence[Film]) -> tuple[Reel, ...]:
    """Return the animations of a run, in their order."""
    return tuple(
        Reel(film, "" if film.reason else f"data:{film.mime};base64,{base64.b64encode(film.data).decode()}")
        for film in films
    )
