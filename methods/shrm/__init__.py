"""Spherical harmonic reflection maps (Ramamoorthi and Hanrahan 2002): local, global, and as pure coefficients."""

from methods.shrm.local import SHRM
from methods.shrm.pure import SHRMCoefficients
from methods.shrm.whole import SHRMGlobal

__all__ = ["SHRM", "SHRMCoefficients", "SHRMGlobal"]
