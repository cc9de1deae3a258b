"""Five representations of one 4D reflected light field, measured: what lies behind RH 2002, table 2.

Tabular: T x T maps by angular prefiltering. Compressed: the same table, vector-quantised over its texels. Factored: its
singular value decomposition, eq. 4. Coefficients: light times lobe, summed at the points. SHRM: the local form.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.clock import fastest
from data_gen import environments, geometry, materials, views
from envbench import latlong
from envbench.directions import to_angles, to_local
from envbench.environment import Environment
from envbench.geometry import Points
from envbench.method import Method, footprint
from envbench.records import Study
from envbench.timing import timed
from methods.angular import Angular
from methods.angular.lookup import look_up
from methods.angular.prefilter import prefilter_at
from methods.shrm.local import SHRM
from methods.shrm.pure import SHRMCoefficients

ROWS, VIEWS, EPS = 64, 12, 0.03
CODES, FACTORS = 256, 9
POINTS = 8192
COMPACT, FEW, RAPID = 0.25, 2.0, 0.1
"""Bytes of the table, numbers a point of the SHRM's, time to make of the table's: up to here the answer is yes."""


@dataclass(frozen=True)
class Made:
    """A representation: what it takes, how it is read, and what is known of its error.

    Attributes
    ----------
    terms : int
        Numbers read a point and channel.
    decode : callable or None
        What must be done before it can be read.
    predicted, from_table : float or None
        NRMSE that theory tells beforehand; that a comparison with the whole table tells.
    """

    bytes: int
    terms: int
    seconds: float
    read: Callable[[], NDArray[Any]]
    decode: Callable[[], Any] | None = None
    predicted: float | None = None
    from_table: float | None = None


def representations() -> Study:
    """Return what each representation takes, and what that says to the questions of the table."""
    sphere = geometry.build({"kind": "sphere"}, "sphere")
    points, _ = views.build({"kind": "uniform", "count": POINTS}, sphere, "uniform")
    light = environments.build({"kind": "captured", "name": "studio", "size": ROWS})
    material = materials.build(materials.MATERIALS["microfacet-whole"], "microfacet-whole")
    lobe = material.lobes[0]
    central = points.central(lobe.centre)
    exact = prefilter_at(light.radiance.astype(np.float32), lobe, central, points.view, points.normal, 1e-6)

    angular = Angular(rows=ROWS, directions=VIEWS, light_rows=ROWS, eps=EPS)
    prepared = angular.prepare(material, sphere)
    maps, seconds = timed(lambda: angular.relight(prepared, light))
    table = maps[0].values
    made = {
        "Tabular": Made(table.nbytes, 16, seconds, lambda: look_up(table, lobe.centre, points)),
        "Compressed": _compressed(table, seconds, lobe.centre, points),
        "Factored": _factored(table, seconds, central, points),
    }
    for name, method in (("Coefficients", SHRMCoefficients(eps=EPS)), ("SHRM", SHRM(eps=EPS, precision="float32"))):
        made[name] = _frequency(method, material, sphere, light, points)
    times = fastest({name: one.read for name, one in made.items()})
    decoding = fastest({name: one.decode for name, one in made.items() if one.decode})
    return _study(made, times, decoding, exact)


def _study(made: dict[str, Made], times: dict[str, float], decoding: dict[str, float], exact: NDArray[Any]) -> Study:
    rows: list[tuple[str | float | int | None, ...]] = []
    for name, one in made.items():
        fast = one.terms <= FEW * made["SHRM"].terms
        answers = (
            "Yes" if one.bytes <= COMPACT * made["Tabular"].bytes else "No",
            "No" if not fast else "Maybe" if name in decoding else "Yes",
            "Yes" if one.predicted is not None else "*" if one.from_table is not None else "No",
            "Yes" if one.seconds <= RAPID * made["Tabular"].seconds else "No",
        )
        off = float(np.sqrt(np.mean((one.read() - exact) ** 2) / np.mean(exact.astype(float) ** 2)))
        decode = 1e3 * decoding[name] if name in decoding else None
        rows.append((name, one.bytes, one.terms, 1e3 * one.seconds, decode, 1e3 * times[name], one.predicted,
                     one.from_table, off, *answers))  # fmt: skip
    return Study(
        "representations",
        "Five representations of one reflected light field",
        f"The microfacet of sigma = .2 under the studio, eps = {EPS:g}; table: S = {ROWS}, T = {VIEWS}; {CODES} codes; "
        f"{FACTORS} factors; {POINTS:,} uniform (R, V) read, the software of this project. Error: NRMSE against the "
        "whole sum over the light's texels. "
        f"Compact: at most {COMPACT:g} of the table's bytes. Rendering: a point takes at most {FEW:g} times the "
        "SHRM's numbers; maybe: once decoded, into all of the table's memory. Analysis: theory tells the error "
        f"beforehand; *: a comparison with the dense table does. Speed: made in at most {RAPID:g} of the table's time.",
        ("representation", "bytes", "numbers a point", "to make (ms)", "to decode (ms)", "to read (ms)",
         "error predicted", "error against the table", "error", "compact", "rendering", "analysis", "speed"),
        tuple(rows),
        (f"The frequency forms keep what the paper keeps, all but {EPS:g} of the BRDF's energy; the table is finer.",
         "The coefficients' many terms are summed by ducc0's non-uniform transform, faster than their number says.",
         "Whether a form is simple is no quantity: that column of the paper's table is not judged.",),
    )  # fmt: skip


def _frequency(method: Method, material: Any, sphere: Any, light: Environment, points: Points) -> Made:
    prepared = method.prepare(material, sphere)
    relit = method.relight(prepared, light)
    seconds = fastest({"": lambda: method.relight(prepared, light)})[""]
    error = method.predictions(prepared, light)["BRDF weighed by the light"]
    kept = prepared.expansion.sums[0] if isinstance(method, SHRM) else prepared.sums[0]
    planes = (kept.P + 1) ** 2
    terms = planes * (16 if isinstance(method, SHRM) else (kept.F + 1) ** 2)
    return Made(footprint(relit), terms, seconds, lambda: method.shade(relit, points), predicted=float(np.sqrt(error)))


def _compressed(table: NDArray[np.float32], seconds: float, centre: Any, points: Points) -> Made:
    from scipy.cluster.vq import kmeans2

    texels = table.reshape(-1, table[0, 0].size)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "One of the clusters is empty")
        (codes, index), more = timed(
            lambda: kmeans2(texels, CODES, iter=8, minit="points", rng=np.random.default_rng(0))
        )
    index = index.astype(np.uint8)

    def decode() -> NDArray[np.float32]:
        return codes[index].reshape(table.shape)

    decoded = decode()
    error = _rms(decoded - table, table)
    size = codes.nbytes + index.nbytes
    return Made(size, 16, seconds + more, lambda: look_up(decoded, centre, points), decode, from_table=error)


def _factored(table: NDArray[np.float32], seconds: float, central: NDArray[Any], points: Points) -> Made:
    rows, columns, views, _, _ = table.shape
    flat = table.reshape(rows * columns, -1, 3).transpose(0, 2, 1).reshape(rows * columns * 3, -1)

    def factors() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        _, vectors = np.linalg.eigh(flat.T @ flat)
        h = vectors[:, ::-1][:, :FACTORS]
        return (flat @ h).reshape(rows, columns, 3 * FACTORS), h.reshape(views, views, FACTORS)

    (g, h), more = timed(factors)
    error = _rms(g.reshape(-1, FACTORS) @ h.reshape(-1, FACTORS).T - flat, flat)

    def read() -> NDArray[Any]:
        theta, phi = to_angles(to_local(points.view, central))
        y, x = theta * (views - 1) / np.pi, phi * views / (2 * np.pi)
        i, j = np.minimum(y.astype(int), views - 2), x.astype(int) % views
        fy, fx = (y - i)[:, None], (x - np.floor(x))[:, None]
        right = (j + 1) % views
        top, bottom = (h[k, j] * (1 - fx) + h[k, right] * fx for k in (i, i + 1))
        at_view = top * (1 - fy) + bottom * fy
        return np.einsum("nca,na->nc", latlong.interpolate(g, central).reshape(-1, 3, FACTORS), at_view)

    return Made(g.nbytes + h.nbytes, 8 * FACTORS, seconds + more, read, from_table=error)


def _rms(off: NDArray[Any], of: NDArray[Any]) -> float:
    return float(np.sqrt(np.mean(off.astype(float) ** 2) / np.mean(of.astype(float) ** 2)))
