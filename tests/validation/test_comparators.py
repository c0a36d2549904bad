"""What the studies compute besides the force laws: terramechanics and curvature, against closed forms."""

import dataclasses
import math

import numpy as np
import pytest
import trimesh
from rftsim_models.wheels import GROUSER_WHEEL

from rftsim import RftsimError, make_surface
from rftsim.run.scenes import POPPY
from rftsim.validation.balance import grousered
from rftsim.validation.drill import RADIUS, curvature_radius, upright
from rftsim.validation.terramechanics import Soil, sinkage_under, wheel_force

R, B, Z = 0.1, 0.05, 0.02
SMOOTH = Soil(k_c=0.0, k_phi=1e6, exponent=1.0, friction=0.0, shear=0.02, c1=0.0, c2=0.0)


def test_frictionless_wheel_is_a_sunken_segment():
    """With p = k z, no shear, the peak at the bottom: load is k b half a segment's area, drawbar -k b z² / 2."""
    force = wheel_force(SMOOTH, R, B, Z, 0.1, (0.1, 0.0))
    entry = math.acos(1 - Z / R)
    assert force.load == pytest.approx(1e6 * B * R**2 * (entry - math.sin(entry) * math.cos(entry)) / 2, rel=1e-4)
    assert force.drawbar == pytest.approx(-1e6 * B * Z**2 / 2, rel=1e-4)
    assert force.side == 0.0


def test_sinkage_under_a_load_carries_it():
    soil = SMOOTH._replace(friction=0.6, c1=0.18, c2=0.32, k_c=1e3)
    sinkage = sinkage_under(soil, 30.0, R, B, 0.1, (0.08, 0.01))
    assert wheel_force(soil, R, B, sinkage, 0.1, (0.08, 0.01)).load == pytest.approx(30.0, rel=1e-9)


def test_shear_never_exceeds_the_friction():
    """A wheel that spins at its place pulls with less than load times friction, and a sliding one is held back."""
    soil = SMOOTH._replace(friction=0.6)
    spinning = wheel_force(soil, R, B, Z, 0.5, (0.0, 0.0))
    assert 0.0 < spinning.drawbar < 0.6 * spinning.load
    aside = wheel_force(soil, R, B, Z, 0.1, (0.1, 0.05))
    assert aside.side < 0.0
    assert wheel_force(soil, R, B, Z, 0.1, (0.1, -0.05)).side == pytest.approx(-aside.side)


def test_the_wheel_by_static_balance():
    """[Agarwal] Table 4.1: 0.85 by an independent planar program, without simulating anything."""
    found = grousered(GROUSER_WHEEL, POPPY, "one third", 1 / 3)
    assert found["rolling"] == pytest.approx(0.85, abs=0.005)
    assert found["sinkage"] == pytest.approx(0.189, abs=0.002)


def test_no_balance_under_a_push_that_is_too_large():
    heavy = dataclasses.replace(GROUSER_WHEEL, forward_force=-1e3)
    with pytest.raises(RftsimError, match="no steady state"):
        grousered(heavy, POPPY, "one third", 1 / 3)


def test_curvature_of_a_sphere():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.03)
    radius = curvature_radius(make_surface(ball.vertices, ball.faces))
    assert np.median(radius) == pytest.approx(0.03, rel=0.02)
    assert radius.min() > 0.015  # at the twelve corners with five neighbours


def test_curvature_of_a_cylinder():
    """Its radius on the wall, none on the ends, and an edge that is sharp for a mesh as fine as the cut-off."""
    surface = upright()
    radius = curvature_radius(surface)
    height = surface.triangles[:, :, 2]
    inner = (height > 0.01) & (height < 0.13)
    assert np.median(radius[inner]) == pytest.approx(RADIUS, rel=0.02)
    ends = np.linalg.norm(surface.triangles[:, :, :2], axis=2) < 0.02
    assert radius[ends].min() > 1.0
    rim = ~ends & ((height < 1e-6) | (height > 0.14 - 1e-6)) & (np.hypot(*surface.triangles[:, :, :2].T).T > 0.0249)
    assert radius[rim].max() < 0.0048
