from dataclasses import dataclass

import numpy as np

from envbench.errors import BadInput
from envbench.method import Method


@dataclass(frozen=True)
class MeanLight(Method):
    """Replace the light by its mean: an ambient term. Radiance = mean light x albedo of the BRDF."""

    name = "mean_light"
    summary = "The light's mean times the BRDF's albedo."
    source = "RH 2002, eq. 2 with constant L"

    grid: int = 8  # the albedo is the mean over grid x grid directions drawn from each lobe

    def __post_init__(self):
        if not 1 <= self.grid <= 64:
            raise BadInput(f"grid must lie in [1, 64]. Got {self.grid} instead.")

    def prepare(self, material, geometry):
        return material.lobes

    def relight(self, prepared, environment):
        return prepared, environment.mean

    def shade(self, framed, points):
        lobes, mean = framed
        u = (np.stack(np.meshgrid(*2 * [np.arange(self.grid)])).reshape(2, -1, 1) + 0.5) / self.grid
        albedo = np.zeros((3, len(points)))
        for lobe in lobes:
            view, normal, centre = points.view.T, points.normal.T, points.central(lobe.centre).T
            light = lobe.sample(u, view, centre, normal)
            pdf = lobe.density(light, view, centre, normal)
            value = np.stack(lobe.evaluate(light, view, centre, normal))
            albedo += np.divide(value, pdf, out=np.zeros_like(value), where=pdf > 0).mean(1)
        return albedo.T * mean
