"""The wheels of [Agarwal] chapter 4: shape, and the trends that the thesis reports."""

import dataclasses

import numpy as np
import pytest
import trimesh
from rftsim_models.outline import extruded, lugged_outline
from rftsim_models.wheels import FOUR_FLAP_RUNNER, GROUSER_WHEEL, HALF_GROUSER_WHEEL, build_wheel

from rftsim import Wheel, add_sand
from rftsim.run.rate_sweep import measure
from rftsim.run.run import run
from rftsim.run.scenes import SCENES, Measured, Staged, stage


def slip_and_sinkage(scene, law, rpm, sand=None, duration=4.0, timestep=None):
    staged = stage(scene, law=law, sand=sand, settings={"rpm": str(rpm)}, duration=duration, timestep=timestep)
    steady = run(staged).steady
    return steady.slip, steady.sinkage / (2 * staged.measured.wheel_radius)


@pytest.mark.parametrize("parameters", [GROUSER_WHEEL, HALF_GROUSER_WHEEL, FOUR_FLAP_RUNNER])
def test_volume_is_that_of_disc_and_lugs(parameters):
    """V = W (disc + N h w), less what the lugs' feet and the rim's chords take, both second order."""
    mesh = trimesh.Trimesh(*extruded(parameters.outline(felt=False), parameters.width))
    p = parameters
    exact = p.width * (np.pi * p.radius**2 + p.lugs * p.lug_height * p.lug_width)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(exact, rel=0.03)


def test_thesis_discretisation():
    """20 grousers at 14 + 3 x 8 elements are 760, not the 570 printed ([Agarwal] section 4.6.2)."""
    assert len(lugged_outline(0.094, 20, 0.004, 0.006, arc=14, flank=8, top=8)) == 760


def test_table_4_1():
    """[Agarwal] Table 4.1: outer diameter 212 mm, 6.3 kg vertical and 23 kg horizontal inertia."""
    model = build_wheel(GROUSER_WHEEL, 60).compile()
    assert 2 * GROUSER_WHEEL.outer_radius == pytest.approx(0.212)
    assert model.body("wheel").mass == pytest.approx(6.3)
    assert model.body_mass.sum() == pytest.approx(23.0)
    assert model.opt.gravity[2] == -9.8


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"radius": 0.0}, "radius"),
        ({"lugs": 200}, "do not fit"),
        ({"horizontal_mass": 1.0}, "vertical_mass"),
        ({"felt_height": -0.1}, "felt_height"),
    ],
)
def test_impossible_wheels(changes, words):
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(GROUSER_WHEEL, **changes)


def test_wheel_speed_is_linear_in_rate_without_speed_in_the_law():
    """[Agarwal] appendix B.2: quasi-static RFT has no speed in it, so steady v / omega is constant."""
    slips = [slip_and_sinkage("grouser-wheel", "rft2d", rpm)[0] for rpm in (10, 90)]
    assert 1 - slips[1] == pytest.approx(1 - slips[0], rel=0.005)
    assert 1 - slips[0] == pytest.approx(0.85, abs=0.01)  # an independent planar program


def test_wheel_slips_and_sinks_with_the_dynamic_terms():
    """[Agarwal] Fig. 4-7: above 30 RPM v / omega falls and sinkage rises; an independent program: 0.85 to 0.77."""
    (slow, shallow), (fast, deep) = (slip_and_sinkage("grouser-wheel", "drft2d", rpm) for rpm in (10, 90))
    assert (1 - fast) / (1 - slow) < 0.95
    assert deep > shallow
    assert 1 - fast == pytest.approx(0.77, abs=0.01)


@pytest.mark.parametrize(("lambda_", "at_100", "at_300"), [(0.0, 0.279, 0.247), (4.0, 0.269, 0.204)])
def test_runner_rises_above_its_turnover(lambda_, at_100, at_300):
    """[Agarwal] Fig. 4-9: sinkage peaks near 100 RPM and falls, with slip; the numbers are an independent program's."""
    sand = f"preset=poppy-seeds,lambda_={lambda_}"
    found = {rpm: slip_and_sinkage("four-flap-runner", "drft2d", rpm, sand, duration=3.0) for rpm in (60, 100, 300)}
    assert found[60][1] < found[100][1] > found[300][1]
    assert found[300][0] < found[100][0]
    assert found[100][1] == pytest.approx(at_100, abs=0.003)
    assert found[300][1] == pytest.approx(at_300, abs=0.003)


@pytest.mark.slow
def test_outline_is_fine_enough():
    """The shipped outline against the thesis's 14 + 3 x 8 elements per grouser."""
    fine = dataclasses.replace(GROUSER_WHEEL, arc=14, flank=8, top=8)
    spec = build_wheel(fine, 60)
    wheel = Wheel((0, 1, 0), (0, 0, 0), fine.outer_radius)
    bed = add_sand(spec, SCENES["grouser-wheel"].sand, "drft2d", max_edge=1.0, wheels={"wheel": wheel})
    steady = run(Staged(spec.compile(), bed, Measured("wheel", fine.outer_radius), 4.0)).steady
    slip, sinkage = slip_and_sinkage("grouser-wheel", "drft2d", 60)
    assert 1 - slip == pytest.approx(1 - steady.slip, rel=0.01)
    assert sinkage == pytest.approx(steady.sinkage / 0.212, rel=0.01)


def test_dimensionless_numbers():
    """omega_0 = sqrt(g / l) of the wheel is 64.9 RPM and sqrt(g l) is 1.441 m/s (PHYSICS of Table 4.1)."""
    point = measure("grouser-wheel", "rft2d", 90)
    assert point.spin == pytest.approx(90 / 64.9, rel=1e-3)
    assert point.speed == pytest.approx((1 - point.slip) * 90 * 2 * np.pi / 60 * 0.106 / 1.441, rel=1e-3)
