"""Sand that remembers: laws of the studies, and what the runs that are shipped say of prints, heaps and ruts."""

import dataclasses

import numpy as np
import pytest
from rftsim_mpm.bed import level_bed
from rftsim_mpm.blade import Blade, plow
from rftsim_mpm.campaign import DATA, results
from rftsim_mpm.errors import MpmError
from rftsim_mpm.footprint import Footprint, press
from rftsim_mpm.material import Material
from rftsim_mpm.rut import Rut, follow_rut
from rftsim_mpm.simulation import Simulation

FOOT = Footprint(cells=5.0, bed=0.4, speed=0.3, rest=0.1)
BLADE = Blade(cells=4.0, travel=0.03, bed=0.7, speed=0.2)


@pytest.fixture(scope="module")
def prints():
    return press(FOOT)


def test_prints_are_similar(prints):
    """Lengths four times, times twice: the surfaces are the same in units of the foot, to the last bits."""
    four = ("length", "depth", "again")
    sizes = {name: 4.0 * getattr(FOOT, name) for name in four}
    times = {name: 2.0 * getattr(FOOT, name) for name in ("speed", "rest", "calm")}
    found = press(dataclasses.replace(FOOT, **sizes, **times))
    for name in ("pressed", "left", "end"):
        np.testing.assert_allclose(
            getattr(found, name).height, 4.0 * getattr(prints, name).height, rtol=1e-9, atol=1e-12
        )


def test_rims_hold_what_the_print_has_lost(prints):
    """Sand is not compressed: what lies above the undisturbed surface has come from below it."""
    assert prints.left.raised == pytest.approx(prints.left.hollow, rel=0.1)
    assert all(abs(relief.missed) < 0.01 for relief in (prints.pressed, prints.left, prints.end))


def test_a_foot_out_of_the_sand_feels_none(prints):
    depth, force = prints.second
    assert np.abs(force[depth < -0.1 * FOOT.length]).max() == 0.0
    assert force[-1] > 0.0


def test_a_heap_holds_what_was_swept():
    found = plow(BLADE)
    ahead = found.reliefs[-1].part(0.0, np.inf)
    assert ahead.raised == pytest.approx(BLADE.depth * found.travel[-1], rel=0.15)
    assert found.growth[1] > 0.0


def test_what_the_grid_does_not_see_dies_down():
    """Random velocities decay within the time that is asked for, momentum stays to round-off, and a drift as it is."""
    elastic = Material(mu=np.inf, young=2e5)
    drift = np.array([0.3, -0.2])
    left = []
    for calm in (0.0, 2e-3):
        sand = level_bed(elastic, (0.2, 0.1), 0.01)
        sand.x += 0.05
        sand.stress[:] = 0.0
        sand.theta[:] = sand.theta_d
        sand.v = drift + 0.01 * np.random.default_rng(1).standard_normal(sand.x.shape)
        sim = Simulation(elastic, sand, 0.01, (0.3, 0.2), gravity=0.0, calm=calm)
        before = sand.momentum
        while sim.time < 0.01:
            sim.step()
        np.testing.assert_allclose(sand.momentum, before, rtol=1e-11)
        left.append(float((sand.v - drift).std()))
    assert left[1] < 0.3 * left[0]


def test_a_wheel_that_comes_nowhere_is_refused():
    with pytest.raises(MpmError, match="longer duration"):
        follow_rut(Rut(dx=0.0055, duration=0.01))


def test_a_wheel_rolls_either_way():
    """A wheel that spins the other way makes the mirror image of both passes and of both surfaces."""
    small = Rut(rpm=120.0, duration=0.25, radius=0.03, grousers=8, height=0.006, dx=0.0056, rest=0.02)
    there, back = follow_rut(small), follow_rut(dataclasses.replace(small, rpm=-120.0))
    for a, b in ((there.first, back.first), (there.second, back.second)):
        np.testing.assert_allclose(b.travel, a.travel, rtol=1e-5, atol=1e-8)
        np.testing.assert_allclose(b.sinkage, a.sinkage, rtol=1e-5)
    np.testing.assert_allclose(back.end.at(there.end.x), there.end.height, atol=1e-3 * small.dx)


@pytest.fixture(scope="module")
def shipped():
    found = {}
    for one in results(DATA / "ruts"):
        for kind, finest in (("footprint", "cells"), ("blade", "cells"), ("rut", "dx")):
            if kind in one:
                found.setdefault(kind, []).append((one[kind][finest], one))
    ordered = {kind: sorted(runs, key=lambda run: run[0], reverse=kind == "rut") for kind, runs in found.items()}
    return {kind: [one for _, one in runs] for kind, runs in ordered.items()}


def test_a_print_is_forgotten_once_the_sole_touches(shipped):
    """At equal depths below the undisturbed surface the second push is nothing at first, and at last the first one.

    Sand at its critical packing has no memory but its shape.
    """
    for run in shipped["footprint"]:
        ratios = np.array(run["ratios"])
        assert ratios[0] == pytest.approx(0.0, abs=0.02)
        assert ratios[-1] == pytest.approx(1.0, abs=0.1)
        assert run["rim_over_print"] == pytest.approx(1.0, abs=0.1)


def test_walls_do_not_stand(shipped):
    """What is left of a print's walls is no steeper than sand can be, arctan mu_int."""
    for run in shipped["footprint"]:
        assert 10.0 < run["wall_deg"] <= np.degrees(np.arctan(run["footprint"]["mu_int"])) + 0.5


def test_the_drag_on_a_blade_grows_with_its_heap(shipped):
    """In plane strain no sand leaves, so that heap and drag grow all the way; the front is as steep as sand can be."""
    for run in shipped["blade"]:
        assert (np.diff(run["drag_N_m"]) > 0.0).all()
        assert (np.diff(run["heap_m"]) > 0.0).all()
        assert run["front_deg"][-1] == pytest.approx(np.degrees(np.arctan(run["blade"]["mu_int"])), abs=4.0)


def test_in_plane_strain_a_wheel_leaves_hardly_a_rut(shipped):
    """What it presses down comes out behind it, as nothing leaves sideways: a tenth of the sinkage is not left."""
    for run in shipped["rut"]:
        assert np.abs(run["rut_m"]).max() < 0.1 * min(run["sinkage_m"])
        assert 0.0 < run["sinkage_m"][1] - run["sinkage_m"][0] < 5e-3
        assert abs(run["slip"][1] - run["slip"][0]) < 0.05  # smaller cells change each slip by more
