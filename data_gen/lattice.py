"""Points of a rank-1 lattice, shifted at random, as a sampler for Dr.Jit loops.

Point i of N = 2^m is frac(i z / N + shift) (Sloan and Joe 1994). Unlike stratified pairs that are padded with each
other, it fills all dimensions together, so that smooth integrands of several bounces converge faster than N^-1/2. How
many points there are is not known to a kernel, which serves any number.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

VECTOR = (
    1, 182667, 469891, 498753, 110745, 446247, 250185, 118627, 245333, 283199, 408519, 391023, 246327, 126539, 399185,
    461527, 300343, 69681, 516695, 436179,
)  # fmt: skip
"""z of the embedded lattice of Cools, Kuo and Nuyens (2006), order 2, 2^20 points."""
ROUNDS = 8
"""Of the hash that shifts come from: with the usual four, neighbouring lattices are correlated by a half."""


@dataclass
class Lattice:
    """Random numbers of each lane of a wavefront, one dimension after the other; part of a loop's state.

    Attributes
    ----------
    step, unit : UInt32
        i / N and 1 / N, in units of 2^-32: multiples wrap around as fractions do.
    shift : UInt32
        Seed that lanes of one shifted lattice have in common, and others not.
    dimension, start, end : UInt32
        The next dimension, that of a point's first number, and the first of those that are independent of each other
        and of the lattice's.
    many : UInt32
        Points that each lane draws, one after the other.
    """

    vector: Any
    step: Any
    unit: Any
    shift: Any
    dimension: Any
    start: Any
    end: Any
    many: Any

    @classmethod
    def of(
        cls, mi: Any, lanes: int, samples: int, seed: Any, dimensions: range = range(len(VECTOR)), many: int = 1
    ) -> Lattice:
        """Return lattices of `samples` points each, one after the other, in some of their dimensions.

        Each lane draws `many` of the points: both are powers of two. Lattices in other dimensions, of any seed, fill
        those together with these.
        """
        import drjit as dr

        lane, each = dr.arange(mi.UInt32, lanes), dr.opaque(mi.UInt32, samples // many)
        shift, _ = mi.sample_tea_32(lane // each, mi.UInt32(seed), ROUNDS)
        unit, taken = dr.opaque(mi.UInt32, 2**32 // samples if samples > 1 else 0), dr.opaque(mi.UInt32, many)
        start, end = mi.UInt32(dimensions.start), mi.UInt32(dimensions.stop)
        return cls(mi.UInt32(VECTOR), lane * taken * unit, unit, shift, mi.UInt32(start), start, end, taken)

    def begin(self, where: Any) -> None:
        """Begin the lane's next point `where` it is to."""
        import drjit as dr

        self.step = self.step + dr.select(where, self.unit, 0)
        self.dimension = dr.select(where, self.start, self.dimension)

    def next_1d(self, active: Any = True) -> Any:
        """Return the numbers in [0, 1) of the next dimension."""
        return self._next(1)[0]

    def next_2d(self, active: Any = True) -> Any:
        """Return the numbers in [0, 1)^2 of the next two dimensions."""
        import mitsuba as mi

        return mi.Point2f(*self._next(2))

    def _next(self, many: int) -> list[Any]:
        import drjit as dr
        import mitsuba as mi

        within = self.dimension + many <= self.end
        # Beyond the lattice, each point has a shift of its own.
        shifts = mi.sample_tea_32(dr.select(within, self.shift, self.shift ^ self.step), self.dimension, ROUNDS)
        numbers: list[Any] = []
        for k in range(many):
            z = dr.gather(mi.UInt32, self.vector, self.dimension + k, within)
            numbers.append(mi.Float((self.step * z + shifts[k]) >> 8) * 2.0**-24)
        self.dimension = self.dimension + many
        return numbers
