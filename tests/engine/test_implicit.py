"""The implicit force at long steps: depth, rest, the energy balance, and MuJoCo's own answer to it."""

import mujoco
import numpy as np
import pytest

import rftsim
from rftsim.bench import hard_cases, stability
from rftsim.files import Kept
from rftsim.model.readout import instances
from rftsim.solver.state import KEPT

SAND = rftsim.Sand(xi_n=0.92e6, mu_surf=0.4)
SHAPES = {
    "plate": ('<geom type="box" size="0.05 0.05 0.005" mass="0.02"/>', 0.005),
    "heavy": ('<geom size="0.05" mass="1.5"/>', 0.05),
    "light": ('<geom size="0.05" mass="0.02"/>', 0.05),
}

PADDLE = """
<mujoco>
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody>
    <body name="paddle" pos="0 0 0.08">
      <joint name="hinge" axis="0 1 0"/>
      <geom type="box" size="0.01 0.04 0.05" pos="0 0 -0.09" mass="0.2"/>
    </body>
  </worldbody>
  <actuator><velocity joint="hinge" kv="1"/></actuator>
</mujoco>
"""


def drop(shape, h, seconds=0.5):
    """Model and data after a drop from rest with the centre 0.05 m above the sand, and the depth [m]."""
    geom, below = SHAPES[shape]
    body = f'<body name="b" pos="0 0 0.05"><freejoint/>{geom}</body>'
    xml = f'<mujoco><option timestep="{h}"/><worldbody>{body}</worldbody></mujoco>'
    model = rftsim.load(xml, SAND, force="implicit")
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=round(seconds / h))
    return model, data, below - data.qpos[2]


@pytest.mark.slow
@pytest.mark.parametrize("h", [1e-4, 1e-3, 2e-3, 5e-3])
def test_plate_keeps_the_energy_balance(h):
    """m g (H + z) = xi_n alpha_z A z^2 / 2 for a flat plate dropped by H: z = 1.505 mm."""
    fall = 0.05 - 0.005
    weight, stiffness = 0.02 * 9.81, 0.92e6 * 0.87574 * 0.01
    exact = (weight + np.sqrt(weight**2 + 2 * stiffness * weight * fall)) / stiffness
    assert exact == pytest.approx(1.505e-3, rel=1e-3)
    assert drop("plate", h)[2] == pytest.approx(exact, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["heavy", "light"])
@pytest.mark.parametrize(("h", "share"), [(1e-3, 0.02), (2e-3, 0.02), (5e-3, 0.02), (1e-2, 0.05)])
def test_spheres_are_as_deep_as_at_short_steps(shape, h, share):
    assert drop(shape, h)[2] == pytest.approx(drop(shape, 1e-4)[2], rel=share)


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("h", [1e-3, 1e-2])
def test_bodies_rest(shape, h):
    """Left alone for 10 s: drift under 0.05 mm, speed under 1e-4 m/s, spin under 1e-3 rad/s, the weight is carried."""
    model, data, _ = drop(shape, h)
    before = data.qpos.copy()
    mujoco.mj_step(model, data, nstep=round(10 / h))
    assert np.linalg.norm(data.qpos[:3] - before[:3]) < 5e-5
    assert np.linalg.norm(data.qvel[:3]) < 1e-4
    assert np.linalg.norm(data.qvel[3:]) < 1e-3
    assert rftsim.wrenches(model, data).force[1][2] == pytest.approx(9.81 * model.body("b").mass[0], rel=1e-6)
    assert rftsim.work(model, data).unsolved == 0


@pytest.mark.slow
def test_few_evaluations_at_rest():
    """A body at rest costs about one evaluation a step."""
    model, data, _ = drop("heavy", 5e-3, seconds=10.0)
    work = rftsim.work(model, data)
    assert work.evaluations + 4 * work.derivatives < 1.2 * work.steps


def test_it_is_the_default():
    xml = '<mujoco><worldbody><body name="b"><freejoint/><geom size=".05"/></body></worldbody></mujoco>'
    model = rftsim.load(xml, SAND)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=3)
    assert rftsim.work(model, data).evaluations > 0
    assert data.plugin_state.size > 0


def foreseen(trial, steps, before=None):
    """Largest difference between the velocity that a step was solved for and MuJoCo's, over the largest velocity.

    Where all is at rest, over 1e-6 m/s.
    """
    model, data = trial.model, trial.data
    worst = 0.0
    for _ in range(steps):
        if before is not None:
            before(data)
        mujoco.mj_step(model, data)
        expected = data.plugin_state[1 + model.nv : 1 + 2 * model.nv]
        solved = expected != 0.0  # the degrees of freedom of islands that have a body near the sand
        if solved.any():
            worst = max(worst, np.abs(expected - data.qvel)[solved].max() / max(np.abs(data.qvel).max(), 1e-6))
    return worst


@pytest.mark.parametrize("case", ["contact", "contact, elliptic cone", "weld", "joint limit", "stuck wheel", "pull"])
@pytest.mark.parametrize("h", [1e-3, 1e-2])
def test_mujoco_answers_as_foreseen(case, h):
    """The equation holds MuJoCo's actuators, constraints and integrator: its step ends where the solver said."""
    trial = hard_cases.CASES[case].build(h, "implicit")
    # MuJoCo's own solver of contacts stops at 1e-8 relative
    trial.model.opt.tolerance, trial.model.opt.iterations = 1e-14, 200
    assert foreseen(trial, round(0.3 / h)) < 1e-5


@pytest.mark.parametrize("h", [2e-3, 2.5e-3, 5e-3])
def test_a_light_foot_stops_under_its_load(h):
    """What ends an equation kicks no body that has stopped: a foot of 10 g comes as deep as at 0.1 ms, within 4 %."""
    fine, coarse = (stability.play("weld", step, "implicit").measured["depth"] for step in (1e-4, h))
    assert coarse == pytest.approx(fine, rel=0.04)


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast"])
def test_every_integrator_answers_as_foreseen(integrator):
    trial = hard_cases.legs(5e-3, "implicit")
    trial.model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    trial.model.opt.tolerance, trial.model.opt.iterations = 1e-14, 200
    assert foreseen(trial, 60) < 1e-5


def test_limited_actuators_answer_as_foreseen():
    """Servos that reach their limits and leave them again: MuJoCo damps only those that are within."""
    trial, rng = hard_cases.legs(5e-3, "implicit"), np.random.default_rng(0)
    trial.model.opt.tolerance, trial.model.opt.iterations = 1e-14, 200
    trial.model.actuator_forcelimited[:], trial.model.actuator_forcerange[:] = 1, (-2.0, 2.0)

    def move(data):
        data.ctrl[:] = rng.normal(size=trial.model.nu) * 0.3

    assert foreseen(trial, 60, move) < 1e-5


@pytest.mark.parametrize("seed", range(4))
def test_random_starts_gain_no_energy(seed):
    """MuJoCo's step does on the sand what was foreseen, split steps and contacts included.

    From the start on the sand has done no work, and in a step it gives back a microjoule of its strain at most. At a
    tenth of the default tolerance steps are split.
    """
    trial = hard_cases.legs(5e-3, "implicit")
    move = hard_cases.start_at_random(trial, seed)
    model, data = trial.model, trial.data
    instances(model)[0].bed.tolerance *= 0.1
    split, total = 0, 0.0
    for _ in range(100):
        move(data)
        before = data.qvel.copy()
        mujoco.mj_step(model, data)
        sand = data.qfrc_passive - data.qfrc_spring - data.qfrc_damper - data.qfrc_gravcomp - data.qfrc_fluid
        work = 0.5 * 5e-3 * sand @ (before + data.qvel)
        total += work
        assert work < 1e-6
        assert total < 1e-9
        split += (data.plugin_state[1 + 2 * model.nv :].view(KEPT)["drift"] > 0.0).any()
    assert split > 5
    assert not trial.failed


def test_forward_leaves_no_trace():
    """mj_forward between steps changes nothing that a step would find."""
    ends = []
    for extra in (0, 3):
        trial = hard_cases.CASES["re-entry"].build(5e-3, "implicit")
        for _ in range(200):
            for _ in range(extra):
                mujoco.mj_forward(trial.model, trial.data)
            mujoco.mj_step(trial.model, trial.data)
        ends.append(np.concatenate([trial.data.qpos, trial.data.qvel, trial.data.plugin_state]))
    assert np.array_equal(*ends)


@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_a_body_at_rest_does_not_creep(speed):
    """A ball that is pushed with half of what the sand bears gives way by v_c h / sqrt(3), and stops.

    v_c is 1e-5 m/s, however fast a body moves that nothing joins it to: each island has an equation of its own.
    """
    xml = """
        <mujoco>
          <option timestep="0.002"/>
          <worldbody>
            <body name="pushed" pos="0 0 -0.1"> <joint type="slide" axis="1 0 0"/> <geom size="0.05"/> </body>
            <body name="other" pos="0 1 -0.01">
              <joint name="drawn" type="slide" axis="1 0 0"/> <geom size="0.02" mass="50"/>
            </body>
          </worldbody>
          <actuator> <velocity joint="drawn" kv="1e4"/> </actuator>
        </mujoco>"""
    explicit, model = rftsim.load(xml, SAND, force="explicit"), rftsim.load(xml, SAND)
    dragged, data = mujoco.MjData(explicit), mujoco.MjData(model)
    dragged.qvel[0] = 1e-2
    mujoco.mj_forward(explicit, dragged)
    data.qfrc_applied[0] = -0.5 * dragged.qfrc_passive[0]
    data.ctrl[0] = data.qvel[1] = speed
    mujoco.mj_step(model, data, nstep=200)
    assert data.qvel[1] == pytest.approx(speed, abs=1e-2)
    assert abs(data.qvel[0]) < 1e-12
    assert data.qpos[0] == pytest.approx(1e-5 * 0.002 / np.sqrt(3.0), rel=0.05)


def test_medians_are_over_what_has_an_answer(tmp_path):
    """A case in which nothing has an exact or converged value is no part of a median."""
    study = stability.Study(tmp_path / "study.json")
    rows = stability.run(study, ("edge-on, stuck", "heavy sphere"), (1e-3, 5e-3), lambda _: None)
    summary = stability.summarise(rows)
    assert summary.error["implicit"] == {h: rows[1].verdicts["implicit", h].error for h in (1e-3, 5e-3)}
    assert summary.nearer == (1, 1)


def test_study_remembers(tmp_path):
    """What was measured is not measured again; another source forgets it."""
    study = stability.Study(tmp_path / "study.json")
    first = study.played("heavy sphere", 1e-2, "implicit")
    again = stability.Study(tmp_path / "study.json")
    assert again.played("heavy sphere", 1e-2, "implicit") == first
    Kept(tmp_path / "study.json", b"another source").get("x", lambda: 1)
    assert stability.Study(tmp_path / "study.json").kept.known == {}


EXACT = {"plate": 0.05}
CLOSE = {"heavy sphere": 0.02, "light sphere": 0.02, "rolling wheel": 0.01, "legs, broken away": 0.03}
LOOSE = {"slope": 0.15}
"""Its height is 0.7 mm after a fall by 25 mm."""


@pytest.mark.slow
@pytest.mark.parametrize("case", hard_cases.CASES)
@pytest.mark.parametrize("h", [1e-3, 5e-3])
def test_hard_case(case, h):
    """Near the exact or converged answer, at rest where the body rests, and at few evaluations a step."""
    expected = stability.references(case)
    played = stability.play(case, h, "implicit")
    verdict = stability.judge(played, expected)
    assert not verdict.error > (EXACT | CLOSE | LOOSE).get(case, 0.07)
    assert not verdict.rest > 1.0
    assert played.evaluations < 6.0


@pytest.mark.slow
@pytest.mark.parametrize("case", ["edge-on plate", "edge-on drag"])
def test_edge_on_at_long_steps(case):
    """At 10 ms within 1 %; solved as a whole before it is split, the plate's first step comes to another solution."""
    played = stability.play(case, 1e-2, "implicit")
    assert stability.judge(played, stability.references(case)).error < 0.01


@pytest.fixture(scope="module")
def starts():
    return stability.random_starts(1000)


@pytest.mark.slow
def test_a_thousand_random_starts(starts):
    """None is lost, and the sand's work in a step is no more than what the strain under a foot holds, microjoules."""
    assert starts.failed == 0
    assert starts.gain < 5e-6


@pytest.mark.slow
def test_capacity_of_the_legs():
    """What the cases of the held and the broken legs take for their capacity is measured.

    A foot that breaks away takes the others along: from one time step to the next the capacity scatters by 3 %.
    """
    measured = np.median([hard_cases.capacity_of_legs(h) for h in np.linspace(4e-4, 2e-3, 9)])
    assert measured == pytest.approx(hard_cases.CAPACITY, rel=0.01)


def test_steady_motion_takes_one_evaluation_a_step():
    """A paddle that a servo turns through sand: what the first guess misses in a step goes on in the next.

    Without that trend the force is evaluated 1.5 times a step, as normals turn and faces come into the sand.
    """
    spec = mujoco.MjSpec.from_string(PADDLE)
    rftsim.add_sand(spec, bodies=["paddle"], reduction=0.0, max_edge=0.01)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0], data.ctrl[0] = -0.7, 6.0, 6.0
    mujoco.mj_step(model, data, nstep=5)
    begun = rftsim.work(model, data)
    mujoco.mj_step(model, data, nstep=65)
    done = rftsim.work(model, data)
    assert data.qpos[0] > 0.8  # out on the other side, all but
    assert done.evaluations - begun.evaluations <= 1.15 * 65
    assert done.derivatives == begun.derivatives
    assert done.unsolved == 0
