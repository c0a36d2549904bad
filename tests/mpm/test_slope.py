"""Sand on a slope: it stands, its floor carries it, mirror images agree, and angles are to surface and gravity."""

import dataclasses
import math

import numpy as np
import pytest
from rftsim_mpm.bed import earth_pressure, level_bed
from rftsim_mpm.errors import MpmError
from rftsim_mpm.material import Material
from rftsim_mpm.simulation import Simulation
from rftsim_mpm.slope import Slope, course, measure

QUICK = Slope(cells=6.0, bed=0.3, depth=0.02, buried=0.1, speed=0.4)


@pytest.mark.parametrize("mu", [0.2, 0.4, 0.5, 0.7, 1.0])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.7, 0.999])
def test_the_first_stress_stands(mu, share):
    """tau <= mu p on a slope of any tangent below mu; the two ends are Jaky's 1 - mu, where that stands, and 1."""
    fall = share * mu
    k = earth_pressure(mu, fall)
    normal = np.diag([k, k, 1.0])
    p = np.trace(normal) / 3.0
    tau = math.sqrt(0.5 * ((normal - p * np.eye(3)) ** 2).sum() + fall**2)
    assert tau <= mu * p * (1.0 + 1e-12)
    assert earth_pressure(mu, mu) == pytest.approx(1.0)
    assert earth_pressure(mu) >= 1.0 - mu


def bed(slope, cells=(30, 16), dx=0.01):
    """Sand on a slope [deg] that sticks to floor and walls, without a plate."""
    material = Material.of_density(0.5, 1512.0, 1e6)
    size = tuple(n * dx for n in cells)
    gravity = Slope(slope=slope).gravity
    sand = level_bed(material, size, dx, gravity=gravity)
    return Simulation(material, sand, dx, (size[0], size[1] + 4 * dx), gravity=gravity, wall_friction=math.inf)


@pytest.mark.parametrize("slope", [10.0, -20.0])
def test_the_slope_stands(slope):
    """In 0.2 s no particle moves a hundredth of a cell; a smooth slope would slide 67 mm at 20 degrees.

    Floor and walls then carry the sand's weight.
    """
    sim = bed(slope)
    start = sim.particles.x[np.argsort(sim.particles.number)].copy()
    impulse, began = np.zeros(2), 0.1
    while sim.time < 0.2:
        sim.step()
        impulse += sim.wall_impulse.sum(axis=(0, 1)) * (sim.time > began)
    moved = np.abs(sim.particles.x[np.argsort(sim.particles.number)] - start)
    assert moved.max() < 1e-2 * sim.dx
    weight = sim.particles.mass.sum() * sim.gravity
    np.testing.assert_allclose(impulse / (sim.time - began), -weight, rtol=0.02)


def test_mirror_images_agree():
    """A slope that falls the other way, and a plate tilted the other way, give the mirror image of the force."""
    job = dataclasses.replace(QUICK, beta=20.0, gamma=90.0)
    image = dataclasses.replace(job, slope=-job.slope, beta=-job.beta)
    np.testing.assert_allclose(measure(image).force, measure(job).force * [-1.0, 1.0], rtol=1e-4)


@pytest.mark.parametrize("slope", [20.0, -20.0, 10.0])
@pytest.mark.parametrize(("beta", "gamma"), [(0.0, 90.0), (90.0, 0.0), (-40.0, 40.0), (40.0, -40.0), (-90.0, 80.0)])
def test_the_same_to_gravity(slope, beta, gamma):
    """On level ground face and motion make the same angles with gravity as they did on the slope."""
    job = Slope(slope=slope, beta=beta, gamma=gamma)
    level = job.as_to_gravity
    down = job.gravity / np.linalg.norm(job.gravity)
    assert level.slope == 0.0
    assert -90.0 < level.beta <= 90.0
    assert level.direction[1] == pytest.approx(-job.direction @ down)
    assert abs(level.leading[1]) == pytest.approx(abs(job.leading @ down))
    assert abs(level.leading @ level.direction) == pytest.approx(abs(job.leading @ job.direction))
    assert job.as_to_surface == dataclasses.replace(job, slope=0.0)


def test_on_level_ground_both_are_the_plate_itself():
    """At slope zero the plate as to the surface and as to gravity are one, and gravity is across the surface."""
    job = Slope(slope=0.0, beta=30.0, gamma=60.0)
    assert job.as_to_surface == job.as_to_gravity == job
    assert course(job).gravity.tolist() == [0.0, -9.81]


@pytest.mark.parametrize(
    ("bad", "said"),
    [({"slope": 27.0}, "below 26.6"), ({"slope": -20.0, "mu_int": 0.3}, "below 16.7"),
     ({"dim": 3, "psi": 30.0}, "psi must be zero")],
)  # fmt: skip
def test_slopes_that_cannot_be(bad, said):
    with pytest.raises(MpmError, match=said):
        Slope(**bad)


def test_a_bed_that_would_slide_is_refused():
    with pytest.raises(MpmError, match=r"does not stand on a slope of 0\.364"):
        level_bed(Material(0.3), (0.1, 0.1), 0.01, gravity=Slope().gravity)
