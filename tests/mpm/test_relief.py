"""The surface as it is read: level beds are level, any gentle surface comes back, and so does the volume below it."""

import math

import numpy as np
import pytest
from rftsim_mpm.bed import level_bed
from rftsim_mpm.errors import MpmError
from rftsim_mpm.material import Material
from rftsim_mpm.relief import Relief, read_relief
from rftsim_mpm.simulation import Simulation

SAND = Material.of_density(0.4, 1512.0, 2e5)
DX, SIZE = 0.01, (0.6, 0.2)


def bed(dim=2, **options):
    size = SIZE if dim == 2 else (0.1, 0.1, 0.1)
    sand = level_bed(SAND, size, DX, **options)
    return Simulation(SAND, sand, DX, (*size[:-1], size[-1] + 0.1))


@pytest.mark.parametrize("ppc", [2, 3, 4])
def test_a_level_bed_reads_level(ppc):
    """Its height is nothing to a thousandth of a cell, and the sand below it is the sand that there is."""
    relief = read_relief(bed(ppc=ppc), SIZE[1])
    assert np.abs(relief.height).max() < 1e-3 * DX
    assert abs(relief.missed) < 1e-3


@pytest.mark.parametrize("phase", np.linspace(0.0, 1.0, 5))
@pytest.mark.parametrize("steepest_deg", [5.0, 20.0, 35.0])
def test_a_surface_comes_back(phase, steepest_deg):
    """Sand up to a wave of 20 cells: its heights come back to a quarter of a cell, its volume to a thousandth."""
    sim, wave = bed(ppc=4), 20 * DX
    size = math.tan(math.radians(steepest_deg)) * wave / (2.0 * math.pi)

    def height(x):
        return -size + size * np.cos(2.0 * math.pi * (x / wave + phase))

    p = sim.particles
    p.select(p.x[:, 1] < SIZE[1] + height(p.x[:, 0]))
    relief = read_relief(sim, SIZE[1])
    inner = slice(2, -2)  # the walls' mirror images kink the wave
    assert np.abs(relief.height - height(relief.x))[inner].max() < 0.25 * DX
    assert abs(relief.missed) < 1e-3


def test_grains_in_the_air_do_not_count():
    sim = bed()
    sim.particles.x[-1] = 0.3, SIZE[1] + 0.05
    assert np.abs(read_relief(sim, SIZE[1]).height[:-3]).max() < 1e-3 * DX


@pytest.mark.parametrize("angle_deg", [10.0, 22.0, 45.0])
def test_slopes_of_walls_and_fronts(angle_deg):
    """A wedge-shaped hollow has the slope of its walls, and upside down it is a heap with that of its front."""
    x = np.linspace(-0.2, 0.2, 401)
    height = np.minimum(np.abs(x) * math.tan(math.radians(angle_deg)) - 0.03, 0.0)
    assert Relief(x, height, 0.0).wall_slope() == pytest.approx(angle_deg)
    assert Relief(x, -height, 0.0).front_slope() == pytest.approx(angle_deg)
    assert Relief(x, height, 0.0).hollow == pytest.approx(0.03**2 / math.tan(math.radians(angle_deg)), rel=1e-3)


def test_solids_have_no_height_over_x_alone():
    with pytest.raises(MpmError, match="dim 2, not 3"):
        read_relief(bed(dim=3), 0.1)
