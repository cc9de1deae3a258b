"""What theory predicts of an SHRM's energy error, the squared NRMSE over uniform (R, V), before anything is rendered.

With r_lq a BRDF's harmonics in the light as seen from theta_o (`methods.shrm.spectrum`) and w_l = sum_m |L_lm|^2 the
light's power in band l, the mean over all rotations of view and normal together is

    mean B^2 = sum_l w_l / (2 l + 1) sum_q U_q r_lq^2,

averaged over theta_o as uniform (R, V) distributes it: N is the half vector, so cos theta_o is uniform about R, has the
density 2 x on [0, 1] about N, and (2 / pi) sqrt(1 - x^2) about a tangent of N. An error is the same sum of what was
left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from envbench import harmonics, latlong
from envbench.environment import Environment
from envbench.material import Centre, Lobe, Material
from methods.shrm.coefficients import MAX_F, LobeCoefficients
from methods.shrm.legendre import associated
from methods.shrm.spectrum import spectrum

Array = NDArray[np.float64]
Lookup = Callable[[Array], Array]
"""The share of degree l's energy that reading a stored form loses, as a function of l."""

AZIMUTHAL = 24
"""Degree q up to which a lobe's dependence on phi is followed."""
TAIL = 0.05
"""Share of the missing energy that may lie beyond the degrees that are followed, unless there would be too many."""


@dataclass(frozen=True)
class Followed:
    """A lobe well beyond its orders, reflectance included: `r` (3, n_o, l, q), `left_out` alike, energies (3, l).

    `beyond` (3,) is the energy in no degree that is followed; n_o is 1 where nothing depends on the view.
    """

    centre: Centre
    kept: LobeCoefficients
    cosines: Array
    weights: Array
    r: Array
    left_out: Array
    energy: Array
    beyond: Array

    @property
    def beyond_order(self) -> Array:
        """Energy of each channel in degrees above F."""
        return self.energy[:, self.kept.F + 1 :].sum(1) + self.beyond


def follow(material: Material, parts: Sequence[LobeCoefficients]) -> tuple[Followed, ...]:
    """Return each lobe of a material well beyond the orders to which its part is kept: what every light shares."""
    return tuple(_follow(lobe, kept) for lobe, kept in zip(material.lobes, parts, strict=True))


def predict(followed: Sequence[Followed], environment: Environment, lookups: Sequence[Lookup]) -> dict[str, float]:
    """Return the predicted energy error by each theory.

    =========================  ======================================================================================
    captured BRDF energy       1 - captured energy of the lobes, as if they were orthogonal (RH 2002, sec. 5.1)
    least of light and BRDF    min(eps_L, eps_rho) at F (sec. 5.1): about F alone, it does not see P
    residual energy            the bound of appendix B, with Lambda^2 = 4 pi / (2 l + 1) for Lambda: about F alone
    BRDF weighed by the light  the missing energy of each degree by the light's power there, and lookup's own error
    =========================  ======================================================================================
    """
    power = light_power(environment, max(f.r.shape[2] - 1 for f in followed))
    total = sum(f.kept.total for f in followed)
    light = light_energy(environment)
    unlit = [1 - _ratio(power[:, : f.kept.F + 1].sum(), light.sum()) for f in followed]
    least = sum(
        min(max(u, 0.0), float(f.beyond_order.sum() / f.kept.total)) * f.kept.total
        for u, f in zip(unlit, followed, strict=True)
        if f.kept.total
    )
    return {
        "captured BRDF energy": _ratio(sum(f.kept.missing * f.kept.total for f in followed), total),
        "least of light and BRDF": _ratio(least, total),
        "residual energy": _residual(followed, power, light),
        "BRDF weighed by the light": _weighed(followed, power, lookups),
    }


def light_power(environment: Environment, order: int) -> Array:
    """Return w_l = sum_m |L_lm|^2 of each channel, (3, order + 1)."""
    alm = harmonics.analyse(environment.radiance, order)
    l, m = harmonics.degrees(order)
    squared = np.abs(alm.astype(np.complex128)) ** 2 * np.where(m == 0, 1, 2)
    return np.stack([np.bincount(l, s, order + 1) for s in squared]).astype(float)


def light_energy(environment: Environment) -> Array:
    """Return int L^2 of the bilinear function, (3,): along each axis a cell holds (a^2 + a b + b^2) / 3."""
    f = environment.radiance.astype(float)
    turned = np.roll(f[[0, -1]], f.shape[1] // 2, axis=1)
    rows = np.concatenate([turned[:1], f, turned[1:]])
    smooth = (rows[:-2] + 4 * f + rows[2:]) / 6
    smooth = (np.roll(smooth, 1, 1) + 4 * smooth + np.roll(smooth, -1, 1)) / 6
    return (f * smooth * latlong.solid_angles(*f.shape[:2])[..., None]).sum((0, 1))


def _follow(lobe: Lobe, kept: LobeCoefficients) -> Followed:
    reflectance = kept.reflectance
    most = min(max(4 * kept.F, 127), MAX_F)
    order = min(max(2 * kept.F + 1, 31), most)
    while True:
        seen = spectrum(lobe, order, AZIMUTHAL)
        scale = np.broadcast_to(reflectance, 3)[:, None]
        by_degree = 2 * np.pi * np.einsum("colq,o,q->cl", seen.r**2, seen.weights, _multiplicity(seen.r), optimize=True)
        energy = np.broadcast_to(by_degree, (3, order + 1)) * scale**2
        total = np.broadcast_to(seen.totals, 3) * scale[:, 0] ** 2
        beyond = np.maximum(total - energy.sum(1), 0)
        if order == most or beyond.sum() <= TAIL * kept.missing * kept.total:
            break
        order = min(2 * order + 1, most)
    f = associated(kept.P, kept.Q, np.arccos(seen.cosines))  # (q, p, o)
    stored = np.einsum("clpq,qpo->colq", kept.full, f, optimize=True)
    left_out = seen.r.copy()
    left_out[:, :, : kept.F + 1, : kept.Q + 1] -= stored
    r, left_out = (np.broadcast_to(a, (3, *a.shape[1:])) * scale[..., None, None] for a in (seen.r, left_out))
    return Followed(lobe.centre, kept, seen.cosines, seen.weights, r, left_out, energy, beyond)


def _residual(followed: Sequence[Followed], power: Array, light: Array) -> float:
    """eps_B <= B_res / (sum_l<=F |B|^2 + B_res), B_res = Lambda_(F+1)^2 (eps_L L_tot) (eps_rho rho_tot)."""
    residual, held = 0.0, 0.0
    for f in followed:
        F = f.kept.F
        unlit = np.maximum(light - power[:, : F + 1].sum(1), 0)
        residual += 4 * np.pi / (2 * F + 3) * float(unlit @ f.beyond_order)
        held += float((4 * np.pi / (2 * np.arange(F + 1) + 1) * power[:, : F + 1] * f.energy[:, : F + 1]).sum())
    return _ratio(residual, held + residual)


@dataclass(frozen=True)
class _Pooled:
    """All lobes about one centre, to one order: `r`, what is left out of it and what lookup loses; `beyond` (3,)."""

    centre: Centre
    cosines: Array
    weights: Array
    r: Array
    left_out: Array
    misread: Array
    beyond: Array

    @property
    def density(self) -> Array:
        """Weights of the nodes of x = cos theta_o under uniform (R, V); they sum to 1."""
        x = self.cosines
        if len(x) == 1:
            return np.ones(1)
        match self.centre:
            case Centre.REFLECTION:
                return self.weights / 2
            case Centre.NORMAL:
                return self.weights * 2 * np.maximum(x, 0)
            case Centre.TANGENT:
                return self.weights * 2 / np.pi * np.sqrt(1 - x**2)

    def square(self, bands: Array) -> Array:
        """Return sum_q U_q bands_lq^2 averaged over theta_o, (3, l)."""
        return np.einsum("colq,o,q->cl", bands**2, self.density, _multiplicity(bands), optimize=True)


def _weighed(followed: Sequence[Followed], power: Array, lookups: Sequence[Lookup]) -> float:
    order = power.shape[1] - 1
    per_degree = power / (2 * np.arange(order + 1) + 1)
    last = per_degree[:, -max(order // 8, 1) :].mean(1)  # what lies beyond the degrees that are followed meets this
    lost, total = 0.0, 0.0
    read = list(zip(followed, lookups, strict=True))
    centres = [
        _pool([(f, r) for f, r in read if f.centre is c], order) for c in dict.fromkeys(f.centre for f in followed)
    ]
    for i, a in enumerate(centres):
        tail = float(last @ a.beyond) / (4 * np.pi)
        total += float((per_degree * a.square(a.r)).sum()) + tail
        lost += float((per_degree * (a.square(a.left_out) + a.square(a.misread))).sum()) + tail
        for b in centres[i + 1 :]:
            total += 2 * float((per_degree * _cross(a, a.r, b, b.r)).sum())
            lost += 2 * float((per_degree * _cross(a, a.left_out, b, b.left_out)).sum())
    return _ratio(lost, total)


def _pool(read: Sequence[tuple[Followed, Lookup]], order: int) -> _Pooled:
    lobes = [f for f, _ in read]
    finest = max(lobes, key=lambda f: len(f.cosines))
    shape = (3, len(finest.cosines), order + 1, max(f.r.shape[3] for f in lobes))
    r, left_out, misread = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for f, lookup in read:
        place = np.s_[:, :, : f.r.shape[2], : f.r.shape[3]]
        r[place] += f.r
        left_out[place] += f.left_out
        misread[place] += (f.r - f.left_out) * np.sqrt(lookup(np.arange(f.r.shape[2], dtype=float)))[:, None]
    beyond = np.sum([f.beyond for f in lobes], axis=0)
    return _Pooled(finest.centre, finest.cosines, finest.weights, r, left_out, misread, beyond)


def _cross(a: _Pooled, of_a: Array, b: _Pooled, of_b: Array) -> Array:
    """Return the mean product of bands (3, n_o, l, q) about two centres, (3, l).

    Of a radially symmetric lobe about N and one about R: band l of the latter, seen at N, theta_o / 2 from R. Other
    pairs are followed in their means alone (l = 0): where a tangent points says little about R.
    """
    if a.centre is Centre.NORMAL:
        a, of_a, b, of_b = b, of_b, a, of_a
    order = of_a.shape[2] - 1
    if a.centre is not Centre.REFLECTION or b.centre is not Centre.NORMAL or len(b.cosines) > 1:
        out = np.zeros((3, order + 1))
        out[:, 0] = (of_a[:, :, 0, 0] @ a.density) * (of_b[:, :, 0, 0] @ b.density)
        return out
    cosines, weights = a.cosines, a.weights
    if len(cosines) == 1:  # the same for every view, but N still moves with it
        cosines, weights = np.polynomial.legendre.leggauss(order + 2)
    f = associated(order, of_a.shape[3] - 1, np.arccos(cosines) / 2)
    seen = np.broadcast_to(of_a, (3, len(cosines), *of_a.shape[2:]))
    at_normal = np.einsum("colq,qlo,q,o->cl", seen, f, _multiplicity(of_a), weights / 2, optimize=True)
    return of_b[:, 0, :, 0] * np.sqrt(4 * np.pi / (2 * np.arange(order + 1) + 1)) * at_normal


def _multiplicity(bands: Array) -> Array:
    """Return U_q of bands (..., q): 1 for q = 0, else 2, for q and -q alike."""
    return np.where(np.arange(bands.shape[-1]) == 0, 1.0, 2.0)


def _ratio(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else 0.0
