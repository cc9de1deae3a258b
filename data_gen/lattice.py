"""Points of a rank-1 lattice, shifted at random, as a sampler for Dr.Jit loops.

Point i of N = 2^m is frac(i z / N + shift) (Sloan and Joe 1994). Unlike stratified pairs that are padded with each
other, it fills all dimensions together, so that smooth integrands of several bounces converge faster than N^-1/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

VECTOR = (
    1, 182667, 469891, 498753, 110745, 446247, 250185, 118627, 245333, 283199, 408519, 391023, 246327, 126539, 399185,
    461527, 300343, 69681, 516695, 436179,
)  # fmt: skip
"""z of the embedded lattice of Cools, Kuo and Nuyens (2006), order 2, 2^20 points; further dimensions are random."""
ROUNDS = 8
"""Of the hash that shifts come from: with the usual four, neighbouring lattices are correlated by a half."""


@dataclass(frozen=True)
class Lattice:
    """Random numbers of each lane of a wavefront.

    Attributes
    ----------
    step : UInt32
        i / N, in units of 2^-32: multiples wrap around as fractions do.
    shift : UInt32
        Seed that lanes of one shifted lattice have in common, and others not.
    """

    mi: Any
    vector: Any
    step: Any
    shift: Any

    @classmethod
    def of(cls, mi: Any, lanes: int, samples: int, seed: Any) -> Lattice:
        """Return lattices of `samples` points each, a power of two, one after the other."""
        import drjit as dr

        index, count = dr.arange(mi.UInt32, lanes), dr.opaque(mi.UInt32, samples)
        shift, _ = mi.sample_tea_32(index // count, mi.UInt32(seed), ROUNDS)
        return cls(mi, mi.UInt32(VECTOR), index * dr.opaque(mi.UInt32, 2**32 // samples), shift)

    def number(self, dimension: Any) -> Any:
        """Return the numbers in [0, 1) of a dimension, a UInt32."""
        import drjit as dr

        mi = self.mi
        within = dimension < len(VECTOR)
        z = dr.gather(mi.UInt32, self.vector, dimension, within)
        own, _ = mi.sample_tea_32(self.shift, dimension, ROUNDS)
        apart, _ = mi.sample_tea_32(self.shift ^ self.step, dimension, ROUNDS)
        return mi.Float(dr.select(within, self.step * z + own, apart) >> 8) * 2.0**-24
