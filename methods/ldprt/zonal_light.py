"""The alternative that the paper rejects: zonal lobes fitted to the light, turned into each point's rest frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from envbench import llvm
from envbench.directions import Array
from envbench.errors import BadInput
from methods.ldprt import basis, fit, shade
from methods.ldprt.diffuse import Diffuse, Lit
from methods.ldprt.lanes import applied, finished, floats, points_last, three, transposed
from methods.ldprt.lobes import Lobes
from methods.ldprt.transfer import Transfer


@dataclass(frozen=True)
class ZonalLight(Diffuse):
    """Lobes for each channel of the light, in place of lobes at each vertex: no fit of the shape, one of each light.

    With y_lm(R^-1 s_i) g_il for the light in the frame at rest, a point sums over lobes as LDPRT does, but over all n^2
    harmonics, three times: nothing can be made of one light for all points, for each turns it otherwise.

    Attributes
    ----------
    lobes : int
        N, for each channel.
    """

    lobes: int = 4

    name = "zonal-light"
    summary = "stores whole transfer vectors at vertices; the light is a few zonal lobes, turned to each point's rest"
    source = "Sloan, Luna and Snyder 2005, sec. 3.2 (rotating transfer versus light)"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.lobes <= 2 * self.order - 1:
            raise BadInput(f"lobes must lie in [1, {2 * self.order - 1}]. Got {self.lobes} instead.")

    def store(self, transfer: Transfer) -> tuple[Any, dict[str, Any]]:
        return transfer.vectors.astype(np.float32), {}

    def specialise(self, light: Array) -> Lobes:
        return fit.fit_light(light, self.lobes)

    def evaluate(self, lit: Lit, vertex: NDArray[np.integer], rotations: Array | None) -> NDArray[np.float32]:
        vectors = lit.asset.stored[vertex]
        if rotations is None:
            return shade.static(vectors, lit.extra.vectors().T)
        return turned_back(lit.extra, vectors, rotations)

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [cls(lobes=count) for count in (1, 3, 4, 6)]


def turned_back(light: Lobes, vectors: NDArray[np.float32], rotations: Array) -> NDArray[np.float32]:
    """Return radiance (k, 3) of transfer vectors (k, n^2) under a light's lobes, turned by R^-1 at each point."""
    llvm.find()
    import drjit as dr
    from drjit.llvm import Float

    n, first = light.order, light.direct_bands
    t, back = floats(points_last(vectors)), transposed(floats(points_last(rotations)))

    def number(value: float) -> Any:
        return dr.opaque(Float, float(value))  # an argument of the kernel: another light compiles nothing anew

    channels: list[Any] = []
    for axes, coefficients, direct in zip(light.axes, light.coefficients, light.direct, strict=True):
        total = number(direct[0]) * t[0]
        if first > 1:  # the linear ones are (-y, z, -x) of a vector
            x, y, z = applied(back, [number(v) for v in (-direct[3], -direct[1], direct[2])])
            total = total - y * t[1] + z * t[2] - x * t[3]
        for axis, lobe in zip(axes, coefficients, strict=True):
            y = basis.evaluate(n, three(applied(back, [number(v) for v in axis])))
            for l in range(first, n):
                band = sum((y[k] * t[k] for k in range(l * l, (l + 1) ** 2)), start=Float(0))
                total = dr.fma(number(lobe[l]), band, total)
        channels.append(total)
    return finished(three(channels))
