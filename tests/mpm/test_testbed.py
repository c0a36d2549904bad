"""A wheel held at a slip and a sinkage: what is prescribed, mirror symmetry, and convergence as a long study."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from rftsim_mpm.errors import MpmError
from rftsim_mpm.rim import Rim
from rftsim_mpm.testbed import HeldWheel, hold

QUICK = HeldWheel(grousers=0, prescribed_slip=0.3, prescribed_sinkage=0.02, dx=0.006, rpm=120.0, duration=0.11)


def test_a_held_wheel_moves_as_prescribed():
    """v = (1 - s) omega r along x at a constant height; the sand bears it and resists its spin."""
    places = []
    found = hold(QUICK, lambda sim, _: places.append(sim.bodies[0].position.copy()))
    way = np.diff(places, axis=0)
    step = 0.11 / len(places)
    np.testing.assert_allclose(way[:, 0] / way[:, 0].mean(), 1.0, atol=1e-9)
    assert way[:, 0].mean() / step == pytest.approx(0.7 * 4.0 * np.pi * 0.094, rel=0.01)
    np.testing.assert_allclose(way[:, 1], 0.0, atol=1e-15)
    load, _, torque, sinkage = found.means
    assert sinkage == pytest.approx(0.02, abs=1e-9)
    assert found.sinking == pytest.approx(0.0, abs=1e-9)
    assert load > 50.0
    assert torque > 0.0


@pytest.mark.parametrize("grousers", [0, 20])
def test_a_wheel_that_turns_the_other_way_feels_the_same(grousers):
    """Mirrored in a plane across its way, everything is the same: bed, wheel and motion."""
    study = dataclasses.replace(QUICK, grousers=grousers, dx=0.005)
    found, mirrored = (hold(dataclasses.replace(study, rpm=rpm)) for rpm in (120.0, -120.0))
    np.testing.assert_allclose(mirrored.means, found.means, rtol=1e-6)
    assert mirrored.rear == pytest.approx(found.rear, abs=1e-4)
    assert 0.0 < found.rear <= found.means[3]


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("ends", [(-40.0, 20.0), (-60.0, -10.0)])
def test_the_rim_is_left_where_the_pressure_vanishes(way, ends):
    """A disc that is pressed from 40 degrees ahead to 20 behind is left 20 degrees behind, however it has turned."""
    rim, angle = Rim(way), np.radians(np.arange(0.25, 360.0, 0.5))
    rng = np.random.default_rng(0)
    for turn in rng.uniform(0.0, 2.0 * np.pi, 20):
        c, s = np.cos(turn), np.sin(turn)
        radial = np.column_stack([np.sin(angle), np.cos(angle)])
        world = radial @ np.array([[c, s], [-s, c]]).T
        behind = np.degrees(np.arctan2(-way * world[:, 0], -world[:, 1]))
        pressure = np.where((behind > ends[0]) & (behind < ends[1]), 100.0, 0.0)
        surface = SimpleNamespace(points=0.1 * radial, normals=radial, areas=np.full(len(angle), 1e-3))
        body = SimpleNamespace(rotation=np.array([[c, s], [-s, c]]))
        rim.look(SimpleNamespace(bodies=[body], surfaces=[surface], traction=[pressure[:, None] * radial]))
    assert np.degrees(rim.rear) == pytest.approx(ends[1], abs=3.1)


def test_a_wheel_under_its_load_sinks_until_the_sand_bears_it():
    """The load comes to m g over the breadth, at a sinkage that hardly grows any more."""
    study = dataclasses.replace(QUICK, prescribed_sinkage=None, duration=0.5)
    found = hold(study)
    assert found.means[0] == pytest.approx(study.mass_z * study.gravity / study.breadth, rel=0.03)
    assert 0.01 < found.means[3] < 0.06
    assert abs(found.sinking) < 0.2 * found.means[3]
    assert found.sinkages[0] == pytest.approx(0.006, abs=1e-3)


@pytest.mark.slow
def test_a_wheel_in_space_feels_the_same_the_other_way():
    """Mirrored, forces are the same within 2 % of the load: points on triangles are no mirror images."""
    study = dataclasses.replace(QUICK, dim=3, radius=0.04, breadth=0.03, dx=0.01, duration=0.055)
    found, mirrored = (np.array(hold(dataclasses.replace(study, rpm=rpm)).means) for rpm in (240.0, -240.0))
    load, _, torque, _ = found
    assert load > 50.0
    assert torque > 0.5
    np.testing.assert_allclose(mirrored[:2], found[:2], atol=0.02 * load)
    assert mirrored[2] == pytest.approx(torque, rel=0.05)


@pytest.mark.parametrize(
    ("bad", "said"),
    [({"prescribed_slip": None}, "prescribed_slip is missing"), ({"shift": 0.3}, "shift"),
     ({"prescribed_slip": 1.5}, "slip"),
     ({"prescribed_sinkage": 0.06}, "sinkage"), ({"grousers": 1}, "grousers"), ({"calm": -1.0}, "calm"),
     ({"mu_2": 0.7, "prescribed_slip": None, "prescribed_sinkage": None}, "without mu_2"),
     ({"dim": 4}, "dim"), ({"dim": 3, "prescribed_slip": None, "prescribed_sinkage": None}, "a free wheel")],
)  # fmt: skip
def test_wheels_that_cannot_be_held(bad, said):
    with pytest.raises(MpmError, match=said):
        dataclasses.replace(QUICK, **bad)


def test_a_free_wheel_is_not_held():
    with pytest.raises(MpmError, match="needs prescribed_slip"):
        hold(HeldWheel())
    with pytest.raises(MpmError, match="two pitches"):
        hold(dataclasses.replace(QUICK, duration=0.05))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("grousers", "sinkage", "others"),
    [(20, 0.03, ({"dx": 0.004}, {"shift": 0.5})), (0, 0.02, ({"shift": 0.5},))],
    ids=["wheel", "disc"],
)
def test_a_held_wheel_in_weak_sand_has_converged(grousers, sinkage, others):
    """At mu 0.4 and cells of 2 mm: load and torque within 5 % of those half a cell aside, the wheel's of those at 4 mm.

    The disc's change by 5 and 7 %; `data/held` goes on to 1.33 mm, and to stronger sand, which has no such limit.
    """
    study = HeldWheel(grousers=grousers, prescribed_slip=0.3, prescribed_sinkage=sinkage, mu_int=0.4, dx=0.002)
    load, _, torque, _ = hold(study).means
    for other in others:
        found = hold(dataclasses.replace(study, **other)).means
        assert (found[0], found[2]) == pytest.approx((load, torque), rel=0.05)
