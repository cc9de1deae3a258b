"""CUReT: 61 samples at 205 geometries (Dana et al. 1999), by the basis of Koenderink and van Doorn (1998).

On the hemisphere, with r = sqrt(2) sin(theta / 2), Zernike's polynomials are orthonormal per sr, 2 r dr dphi = d omega:

    Theta_nl(theta) = sqrt((n + 1) / (2 pi)) R_nl(r),   n - l even,   times cos(l phi) and sin(l phi).

A BRDF of paint and cloth depends on phi_i - phi_o alone, is its own mirror image and reciprocal; the products left are

    S_nml = [Theta_nl(theta_i) Theta_ml(theta_o) + Theta_ml(theta_i) Theta_nl(theta_o)] cos(l (phi_i - phi_o)) c_nml,

l <= n <= m <= 8: 55 of them, orthonormal over pairs of directions with c = 1/2 for n = m, else 1 / sqrt(2), times
sqrt(2) for l > 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import eval_jacobi

from data_gen.measured.files import numbers
from data_gen.measured.table import Table
from data_gen.measured.tabulation import Fidelity, tabulate
from envbench.directions import Array, to_angles
from envbench.errors import BadInput, unknown

ORDER = 8
RIDGES = (0.0, 0.01, 0.03, 0.1, 0.3)
NAMES = (
    "felt", "polyester", "terrycloth", "rough plastic", "leather", "sandpaper", "velvet", "pebbles", "frosted glass",
    "plaster a", "plaster b", "rough paper", "artificial grass", "roof shingle", "aluminum foil", "cork", "rough tile",
    "rug a", "rug b", "styrofoam", "sponge", "lambswool", "lettuce leaf", "rabbit fur", "quarry tile", "loofa",
    "insulation", "crumpled paper", "polyester zoomed", "plaster b zoomed", "rough paper zoomed",
    "roof shingle zoomed", "slate a", "slate b", "painted spheres", "limestone", "brick a", "ribbed paper",
    "human skin", "straw", "brick b", "corduroy", "salt crystals", "linen", "concrete a", "cotton", "stones",
    "brown bread", "concrete b", "concrete c", "corn husk", "white bread", "soleirolia plant", "wood a", "orange peel",
    "wood b", "peacock feather", "tree bark", "cracker a", "cracker b", "moss",
)  # fmt: skip
"""Sample 1 to 61, as public loaders of the database list them; the files have numbers only."""

GEOMETRIES = 205
SHAPES = ((64, 46, 31), (64, 46, 61))
"""Grids: a fit of order 8 is smooth."""
_BLOCK = 8192


@dataclass(frozen=True)
class Fit:
    """The sum of S_nml that is nearest to a sample's measurements.

    Attributes
    ----------
    coefficients : (55,)
        In 1/sr.
    residual : float
        RMS of what the fit leaves over the RMS of the measurements.
    left_out : float
        The same, each measurement predicted from the others: what the fit is worth between them.
    condition : float
        Ratio of the largest to the smallest singular value of the equations.
    ridge : float
        Weight of the coefficients' squares that makes `left_out` least, among `RIDGES`.
    masked : int
        Measurements of 0 or less, in the noise, that are left out.
    """

    coefficients: Array
    residual: float
    left_out: float
    condition: float
    ridge: float
    masked: int

    def __call__(self, light: Array, view: Array) -> Array:
        """Return f (n, 3) in 1/sr, the same for r, g and b, for directions (n, 3), N = z; may be negative."""
        (theta_i, phi_i), (theta_o, phi_o) = to_angles(light), to_angles(view)
        angles = theta_i, theta_o, phi_i - phi_o
        blocks = [slice(k, k + _BLOCK) for k in range(0, len(light), _BLOCK)]
        f = np.concatenate([basis(*(a[block] for a in angles)) @ self.coefficients for block in blocks])
        return np.repeat(f[:, None], 3, axis=1)


def basis(theta_i: Array, theta_o: Array, turn: Array) -> Array:
    """Return the 55 S_nml at angles (n,) in radians, turn = phi_i - phi_o, shape (n, 55)."""
    r_i, r_o = np.sqrt(2) * np.sin(theta_i / 2), np.sqrt(2) * np.sin(theta_o / 2)
    columns: list[Array] = []
    for l in range(ORDER + 1):
        degrees = range(l, ORDER + 1, 2)
        i, o = ({n: _radial(n, l, r) for n in degrees} for r in (r_i, r_o))
        azimuthal = np.cos(l * turn) * (np.sqrt(2) if l else 1)
        for n in degrees:
            for m in range(n, ORDER + 1, 2):
                c = 1 / 2 if n == m else np.sqrt(1 / 2)
                columns.append(c * (i[n] * o[m] + i[m] * o[n]) * azimuthal)
    return np.stack(columns, axis=-1)


def _radial(n: int, l: int, r: Array) -> Array:
    """sqrt((n + 1) / (2 pi)) R_nl(r) by Jacobi's polynomials, up to a sign, which the coefficients take up."""
    return np.sqrt((n + 1) / (2 * np.pi)) * r**l * eval_jacobi((n - l) // 2, l, 0, 1 - 2 * r * r)


def fit(folder: Path, sample: int | str) -> Fit:
    """Fit a sample, by its number or name, to ``table.txt`` and ``abrdf.dat`` of a folder: least squares with a ridge.

    Raises
    ------
    BadInput
        There is no such sample, or a file is cut short, holds something else, or nothing but zeros.
    """
    number = _number(sample)
    _, theta_o, phi_o, theta_i, phi_i = _rows(folder / "table.txt", GEOMETRIES, 5).T
    values = _rows(folder / "abrdf.dat", len(NAMES), 1 + GEOMETRIES)[number - 1, 1:]
    if max(theta_i.max(), theta_o.max()) > np.pi / 2:
        raise BadInput(f"{folder / 'table.txt'}: a direction lies below the surface; angles must be in radians.")
    kept = values > 0
    if kept.sum() < 55:
        raise BadInput(f"{folder / 'abrdf.dat'}: sample {number} has {kept.sum()} values above 0; 55 are needed.")
    f = values[kept]
    u, s, v = np.linalg.svd(basis(theta_i, theta_o, phi_i - phi_o)[kept], full_matrices=False)
    candidates: list[Fit] = []
    for ridge in RIDGES:
        damped = s**2 / (s**2 + ridge**2)
        off = f - (u * damped) @ (u.T @ f)
        others = off / (1 - (u**2 * damped).sum(1))  # what is left when a measurement does not take part
        coefficients = v.T @ (damped / s * (u.T @ f))
        rms = float(np.sqrt(np.mean(f**2)))
        residual, left_out = (float(np.sqrt(np.mean(x**2))) / rms for x in (off, others))
        candidates.append(Fit(coefficients, residual, left_out, float(s[0] / s[-1]), ridge, int((~kept).sum())))
    return min(candidates, key=lambda found: found.left_out)


def table(folder: Path, sample: int | str) -> tuple[Table, Fidelity, Fit]:
    """Tabulate the fit of a sample."""
    found = fit(folder, sample)
    number = _number(sample)
    return *tabulate(f"curet {number} {NAMES[number - 1]}", found, symmetric=True, shapes=SHAPES), found


def _number(sample: int | str) -> int:
    """Return the number 1 ... 61 of a sample."""
    if isinstance(sample, str):
        wanted = sample.lower().replace("-", " ")
        if wanted not in NAMES:
            raise unknown("CUReT sample", wanted, NAMES)
        return NAMES.index(wanted) + 1
    if not 1 <= sample <= len(NAMES):
        raise BadInput(f"CUReT sample must be a number from 1 to {len(NAMES)}, or its name. Got {sample} instead.")
    return sample


def _rows(path: Path, count: int, width: int) -> Array:
    """Read rows of numbers that begin with 1, 2, 3 ..."""
    values = numbers(path)
    if values.size != count * width:
        raise BadInput(f"{path}: must hold {count} rows of {width} numbers. Got {values.size} numbers; get it again.")
    rows = values.reshape(count, width)
    if not np.array_equal(rows[:, 0], np.arange(1, count + 1)):
        raise BadInput(f"{path}: its rows must be numbered from 1 to {count}; get it again.")
    return rows
