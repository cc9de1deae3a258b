"""Turn a stored run into one self-contained HTML file; reads the engine's records only."""

from reports.page import render, write

__all__ = ["render", "write"]
