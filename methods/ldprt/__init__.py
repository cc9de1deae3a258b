"""Local, deformable precomputed radiance transfer (Sloan, Luna and Snyder 2005)."""
