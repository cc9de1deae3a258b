"""What is run: suites, and the catalogue of all that a suite may name."""

from benchmarks.catalogue import CATALOGUE

__all__ = ["CATALOGUE"]
