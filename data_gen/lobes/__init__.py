"""The analytic lobes, one a file: each is written once, for NumPy and Dr.Jit alike.

Evaluation, sampling and density of a lobe derive from the same few lines.
"""

from data_gen.lobes.cook_torrance import CookTorrance
from data_gen.lobes.ggx import GGX
from data_gen.lobes.kajiya_kay import KajiyaKay, KajiyaKayDiffuse
from data_gen.lobes.lafortune import Lafortune
from data_gen.lobes.lambertian import Lambertian
from data_gen.lobes.membrane import Membrane
from data_gen.lobes.microfacet import Microfacet
from data_gen.lobes.phong import Phong

__all__ = [
    "GGX", "CookTorrance", "KajiyaKay", "KajiyaKayDiffuse", "Lafortune", "Lambertian", "Membrane", "Microfacet",
    "Phong",
]  # fmt: skip
