"""A material as a Mitsuba BSDF: evaluation, sampling and density all derive from its lobes.

Mitsuba's local frame has the shading normal along z and the tangent along x, and its ``eval`` includes the cosine, as
our rho_hat does. Whole lobes reach below the horizon, so no side is culled.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from data_gen.lobes import Membrane
from data_gen.lobes.draws import albedo
from envbench.material import Centre, Lobe, Material, Texture

_NORMAL = (0.0, 0.0, 1.0)
_TANGENT = (1.0, 0.0, 0.0)


def bsdf(material: Material) -> Any:
    """Return the `mi.BSDF` of `material`, for the variant that is set (another variant needs another call).

    A map of transparency is looked up at the interaction's uv.

    A lobe is chosen in proportion to what it reflects of constant light. Its draws are rejected (weight zero) where
    the lobe is clipped, and its density is zero there, so the density may integrate to less than 1.
    """
    import mitsuba as mi

    chances = _chances(material.lobes)
    map_ = None if material.transparency is None else texture(mi, material.transparency)

    def lobes_at(uv: Any) -> tuple[Lobe, ...]:
        if map_ is None:
            return material.lobes
        r, g, b = map_.eval(uv)
        alpha = (r + g + b) / 3
        return tuple(replace(o, transparency=alpha) if isinstance(o, Membrane) else o for o in material.lobes)

    class Lobes(mi.BSDF):  # Mitsuba's types belong to a variant: so does this class
        def __init__(self) -> None:
            super().__init__(mi.Properties())
            self.m_flags = mi.BSDFFlags.Glossy | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [self.m_flags]

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            wo, valid = _draw(mi, lobes_at(si.uv), chances, si.wi, sample1, sample2)
            value, pdf = self.eval_pdf(ctx, si, wo)
            valid = valid & active & (pdf > 0)
            sample: Any = mi.BSDFSample3f(wo)
            sample.pdf = _select(mi, valid, pdf, mi.Float(0))
            sample.eta = 1.0
            sample.sampled_type = mi.UInt32(+self.m_flags)
            sample.sampled_component = mi.UInt32(0)
            return sample, _select(mi, valid, value / _select(mi, valid, pdf, mi.Float(1)), mi.Color3f(0))

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[1]

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            value, pdf = mi.Color3f(0), mi.Float(0)
            for lobe, chance in zip(lobes_at(si.uv), chances, strict=True):
                frame = (si.wi, _centre(lobe, si.wi), _NORMAL)
                value += mi.Color3f(*(mi.Float(v) for v in lobe.evaluate(wo, *frame)))
                density = mi.Float(chance * lobe.density(wo, *frame))
                pdf += _select(mi, wo.z > 0, density, mi.Float(0)) if lobe.clipped else density
            return _select(mi, active, value, mi.Color3f(0)), _select(mi, active, pdf, mi.Float(0))

        def to_string(self) -> str:
            return f"Lobes[{material.name}]"

    return Lobes()


def texture(mi: Any, map_: Texture) -> Any:
    """Return a texture as a `mi.Texture2f`, which is bilinear and repeats."""
    import drjit as dr

    return mi.Texture2f(mi.TensorXf(map_.values), wrap_mode=dr.WrapMode.Repeat)


def _chances(lobes: tuple[Lobe, ...]) -> tuple[float, ...]:
    if len(lobes) == 1:
        return (1.0,)
    reflected = np.array([albedo(lobe).mean() for lobe in lobes])
    chances = reflected / reflected.sum() if reflected.sum() > 0 else np.full(len(lobes), 1 / len(lobes))
    return tuple(float(chance) for chance in chances)


def _centre(lobe: Lobe, view: Any) -> Any:
    match lobe.centre:
        case Centre.REFLECTION:
            return (-view.x, -view.y, view.z)
        case Centre.NORMAL:
            return _NORMAL
        case Centre.TANGENT:
            return _TANGENT


def _draw(
    mi: Any, lobes: tuple[Lobe, ...], chances: tuple[float, ...], view: Any, sample1: Any, sample2: Any
) -> tuple[Any, Any]:
    """Draw a direction from the lobe that `sample1` chooses, and tell whether there is one."""
    wo, valid = mi.Vector3f(0), mi.Bool(False)
    bounds = np.cumsum((0.0, *chances))
    bounds[-1] = 2.0  # beyond any rounding
    for lobe, low, high in zip(lobes, bounds[:-1], bounds[1:], strict=True):
        x, y, z = lobe.sample((sample2.x, sample2.y), view, _centre(lobe, view), _NORMAL)
        drawn = mi.Vector3f(mi.Float(x), mi.Float(y), mi.Float(z))
        chosen = mi.Bool((sample1 >= float(low)) & (sample1 < float(high)))
        exists = (drawn.x * drawn.x + drawn.y * drawn.y + drawn.z * drawn.z) > 0.5
        if lobe.clipped:
            exists = exists & (drawn.z > 0)
        wo, valid = _select(mi, chosen, drawn, wo), _select(mi, chosen, mi.Bool(exists), valid)
    return wo, valid


def _select(mi: Any, condition: Any, yes: Any, no: Any) -> Any:
    import drjit as dr

    return dr.select(mi.Bool(condition), yes, no)
