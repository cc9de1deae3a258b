"""Local, deformable precomputed radiance transfer (Sloan, Luna and Snyder 2005), and what stands beside it."""

from methods.ldprt.glossy_lobes import GlossyLDPRT
from methods.ldprt.vectors import SHRotation, StaticPRT
from methods.ldprt.zonal import LDPRT, BentNormal, LinearLobe
from methods.ldprt.zonal_light import ZonalLight

__all__ = ["LDPRT", "BentNormal", "GlossyLDPRT", "LinearLobe", "SHRotation", "StaticPRT", "ZonalLight"]
