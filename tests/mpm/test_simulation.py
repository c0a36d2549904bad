"""Laws that every simulation keeps: rest, momentum, similarity, symmetry, friction on walls and bodies."""

import math

import numpy as np
import pytest
from rftsim_mpm.bed import Particles, level_bed
from rftsim_mpm.body import Body, plane_rotation
from rftsim_mpm.errors import MpmError
from rftsim_mpm.material import Material
from rftsim_mpm.shapes import box, polygon, wheel
from rftsim_mpm.simulation import Simulation

SAND = Material.of_density(0.4, 1512.0, 2e5)
ELL = np.array([[0.0, 0.0], [0.06, 0.0], [0.06, 0.02], [0.02, 0.02], [0.02, 0.06], [0.0, 0.06]]) - 0.02


def small_bed(dim, material=SAND, dx=0.01, **options):
    size = (0.2, 0.1) if dim == 2 else (0.12, 0.08, 0.06)
    return level_bed(material, size, dx, **options), size


def plate(dim, size, *, speed=0.2, depth=0.01, friction=0.35, **options):
    shape = box(*((0.06, 0.03) if dim == 2 else (0.04, 0.04, 0.03)))
    place = np.array([0.5 * s for s in size[:-1]] + [size[-1] - depth + 0.015])
    return Body(shape, place, np.array([0.03] * (dim - 1) + [-speed]), friction, **options)


def box_over(size, above=0.08):
    return (*size[:-1], size[-1] + above)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_level_bed_stays_at_rest(dim):
    """Hydrostatic settling: with K_0 in [K_a, 1] nothing flows and sigma_zz = -rho g depth; surface cells aside."""
    bed, size = small_bed(dim)
    sim = Simulation(SAND, bed, 0.01, box_over(size))
    for _ in range(400):
        sim.step()
    depth = size[-1] - bed.x[:, -1]
    deep = depth > 0.02
    expected = SAND.rho_c * 9.81 * depth[deep]
    assert np.abs(-bed.stress[deep, 2] / expected - 1.0).max() < 0.1
    assert np.mean(-bed.stress[deep, 2] / expected) == pytest.approx(1.0, abs=0.01)
    assert np.abs(bed.v).max() < 2e-3
    assert sim.wall_impulse[-1, 0, -1] / sim.dt == pytest.approx(bed.mass.sum() * 9.81, rel=0.05)


@pytest.mark.parametrize("dim", [2, 3])
def test_momentum_budget(dim):
    """Force on the bodies + walls + weight = rate of change of the sand's momentum, to round-off, in every step."""
    bed, size = small_bed(dim)
    free = plate(dim, size, mass=3.0, load=np.array([0.0] * (dim - 1) + [-29.0]))
    free.position[0] -= 0.0501
    bodies = [plate(dim, size), free] if dim == 2 else [plate(dim, size)]
    sim = Simulation(SAND, bed, 0.01, box_over(size), bodies=bodies, wall_friction=0.3)
    sim.clear_bodies()
    weight = np.array([0.0] * (dim - 1) + [-9.81]) * bed.mass.sum()
    pushed = 0.0
    for _ in range(60):
        before = bed.momentum
        carried = free.mass * free.velocity if dim == 2 else 0.0
        sim.step()
        impulse = (weight - sim.force.sum(axis=0)) * sim.dt + sim.wall_impulse.sum(axis=(0, 1))
        scale = np.abs(weight).max() * sim.dt
        np.testing.assert_allclose(bed.momentum - before, impulse, atol=1e-11 * scale)
        if dim == 2:
            gained = free.mass * free.velocity - carried
            np.testing.assert_allclose(gained, (sim.force[1] + free.load) * sim.dt, atol=1e-11 * scale)
        pushed = max(pushed, abs(sim.force[0, -1]))
    assert pushed > 1.0
    assert np.abs(sim.wall_impulse[-1, 0, :-1]).max() > 0.0, "the floor rubs"


def scaled_run(length, density, steps=150):
    """A plate pushed into a bed, everything scaled to equal dimensionless groups."""
    gravity, dx = 9.81, 0.01 * length
    material = Material.of_density(0.4, 1512.0 * density, 2e5 * density * length)
    bed = level_bed(material, (0.2 * length, 0.1 * length), dx)
    shape = box(0.06 * length, 0.03 * length)
    body = Body(
        shape, np.array([0.103, 0.105]) * length, np.array([0.0, -0.2]) * math.sqrt(length), 0.35, plane_rotation(0.2)
    )
    sim = Simulation(
        material, bed, dx, (0.2 * length, 0.18 * length), bodies=[body], gravity=gravity, wall_friction=0.2
    )
    sim.clear_bodies()
    for _ in range(steps):
        sim.step()
    return sim.force[0] / (density * length**2), sim.moment[0] / (density * length**3)


@pytest.mark.parametrize(("length", "density"), [(4.0, 1.0), (3.7, 0.31), (0.01, 2.0)])
def test_similarity(length, density):
    """F/(rho g L^2) and M/(rho g L^3) depend on z/L, mu_s, mu_f, v^2/(g L) and rho g L/K alone, to round-off."""
    expected, found = scaled_run(1.0, 1.0), scaled_run(length, density)
    assert abs(expected[0][1]) > 10.0
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-7)
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-6)


def test_a_smooth_wall_is_a_plane_of_symmetry():
    """Half a bed against a frictionless wall moves as the half of a whole bed, to round-off."""
    dx, speed = 0.01, np.array([0.0, -0.2])
    whole, half = level_bed(SAND, (0.24, 0.1), dx), level_bed(SAND, (0.12, 0.1), dx)
    bodies = [Body(box(0.06, 0.03), np.array([middle, 0.105]), speed, 0.35) for middle in (0.12, 0.0)]
    sims = [
        Simulation(SAND, bed, dx, (width, 0.18), bodies=[body], wall_friction=np.array([[0.0, 0.0], [0.3, 0.0]]))
        for bed, width, body in ((whole, 0.24, bodies[0]), (half, 0.12, bodies[1]))
    ]
    for sim in sims:
        sim.clear_bodies()
        for _ in range(200):
            sim.step()
    assert sims[0].force[0, 0] == pytest.approx(0.0, abs=1e-8)
    assert sims[1].force[0, 1] == pytest.approx(0.5 * sims[0].force[0, 1], rel=1e-9)
    right = whole.x[:, 0] > 0.12
    a = np.sort((whole.x[right] - [0.12, 0.0]) @ [1.0, np.pi])
    np.testing.assert_allclose(a, np.sort(half.x @ [1.0, np.pi]), atol=1e-10)


def test_deterministic():
    """Two runs are the same to the last bit."""
    forces = []
    for _ in range(2):
        bed, size = small_bed(3)
        sim = Simulation(SAND, bed, 0.01, box_over(size), bodies=[plate(3, size)])
        sim.clear_bodies()
        for _ in range(100):
            sim.step()
        forces.append((sim.force.tobytes(), bed.x.tobytes(), bed.stress.tobytes()))
    assert forces[0] == forces[1]


def block(dx, angle, mu, cells=(24, 3)):
    """An elastic slab on a wall, gravity tilted by an angle; low, since a mirror would hold a block that tips."""
    material = Material.of_density(math.inf, 1500.0, 1e6)
    bed = level_bed(material, (cells[0] * dx, cells[1] * dx), dx, gravity=9.81 * math.cos(angle))
    bed.x[:, 0] += 4.0 * dx
    gravity = 9.81 * np.array([math.sin(angle), -math.cos(angle)])
    return Simulation(material, bed, dx, (60 * dx, 12 * dx), gravity=gravity, wall_friction=mu)


@pytest.mark.parametrize("angle", [25.0, 35.0])
def test_block_slides_on_an_incline(angle):
    """v = g (sin a - mu cos a) t on a slope steeper than atan mu.

    For as long as the whole base presses: later the slab begins to flutter, and a mirror pulls on what lifts off.
    """
    mu, angle = 0.3, math.radians(angle)
    sim = block(0.01, angle, mu)
    mass = sim.particles.mass.sum()
    while sim.time < 0.04:
        sim.step()
    expected = 9.81 * (math.sin(angle) - mu * math.cos(angle)) * sim.time
    assert sim.particles.momentum[0] / mass == pytest.approx(expected, rel=0.04)  # it rings along the slope


def test_block_sticks_on_a_flat_slope():
    """Below atan mu it stays, but for its own elastic strain."""
    sim = block(0.01, math.radians(10.0), 0.3)
    start = sim.particles.x.copy()[np.argsort(sim.particles.number)]
    while sim.time < 0.1:
        sim.step()
    moved = sim.particles.x[np.argsort(sim.particles.number)] - start
    assert np.abs(moved).max() < 1e-4


def test_a_body_slides_on_sand_by_its_friction():
    """A block in contact with sand that cannot yield slides as on an incline: Coulomb friction of the contact."""
    stiff, mu, angle = Material.of_density(math.inf, 1500.0, 1e6), 0.2, math.radians(20.0)
    bed = level_bed(stiff, (0.4, 0.05), 0.01, gravity=9.81 * math.cos(angle))
    gravity = 9.81 * np.array([math.sin(angle), -math.cos(angle)])
    sinks = 0.005  # contact is half a cell inside
    mass = 6.0
    body = Body(box(0.06, 0.04), np.array([0.1, 0.05 + 0.02 - sinks]), np.zeros(2), mu, mass=mass, load=mass * gravity)
    sim = Simulation(stiff, bed, 0.01, (0.4, 0.12), bodies=[body], gravity=gravity, wall_friction=math.inf)
    while sim.time < 0.15:
        sim.step()
    pressed = 9.81 * math.cos(angle) * sim.time + body.velocity[1]  # it still bounces a little
    assert body.velocity[0] == pytest.approx(9.81 * math.sin(angle) * sim.time - mu * pressed, rel=0.005)


@pytest.mark.parametrize("spin", [2.0, 5.0])
def test_a_prescribed_spin_turns_the_shape(spin):
    """In the plane a positive spin about y takes +x to -z."""
    bed, size = small_bed(2)
    body = Body(wheel(0.03, 6, 0.01, 0.02), np.array([0.1, 0.16]), np.zeros(2), spin=np.array([spin]))
    sim = Simulation(SAND, bed, 0.01, box_over(size), bodies=[body], inset=0.1)
    while sim.time < 0.1:
        sim.step()
    angle = spin * sim.time
    np.testing.assert_allclose(body.rotation @ [1.0, 0.0], [math.cos(angle), -math.sin(angle)], atol=1e-9)
    np.testing.assert_allclose(body.velocity, 0.0)


def test_free_rotation_keeps_angular_momentum():
    """Without sand or load a solid body keeps R I R^T omega; the error is of first order in the step."""
    errors = []
    for dt in (1e-3, 5e-4):
        body = Body(
            box(0.1, 0.2, 0.3),
            np.zeros(3),
            np.zeros(3),
            mass=1.0,
            inertia=np.diag([1.0, 2.0, 2.5]),
            spin=np.array([1.0, 2.0, 0.5]),
        )
        start = body.rotation @ body.inertia @ body.rotation.T @ body.spin
        for k in range(round(1.0 / dt)):
            body.advance(np.zeros(3), np.zeros(3), k * dt, dt)
        assert np.allclose(body.rotation @ body.rotation.T, np.eye(3), atol=1e-12)
        errors.append(np.linalg.norm(body.rotation @ body.inertia @ body.rotation.T @ body.spin - start))
    assert errors[0] < 0.02
    assert errors[1] < 0.6 * errors[0]


def test_a_notch_that_the_sand_does_not_see_changes_nothing():
    """Two outlines with the same lower face push alike."""
    forces = []
    for shape in (box(0.06, 0.06), polygon(np.vstack([box(0.06, 0.06).vertices, [[-0.03, 0.0], [-0.02999, -0.0001]]]))):
        bed, size = small_bed(2)
        body = Body(shape, np.array([0.1, 0.13 - 0.015]), np.array([0.0, -0.1]), 0.35)
        sim = Simulation(SAND, bed, 0.01, box_over(size), bodies=[body])
        sim.clear_bodies()
        for _ in range(200):
            sim.step()
        forces.append(sim.force[0, 1])
    assert forces[0] > 10.0
    assert forces[1] == pytest.approx(forces[0], rel=0.02)


def test_xpic_calms_and_keeps_momentum():
    """The filter takes the velocity that the grid does not see, and no momentum."""
    bed, size = small_bed(2)
    rng = np.random.default_rng(0)
    bed.v = rng.normal(scale=0.01, size=bed.v.shape)
    energies = []
    for order in (0, 2, 1):
        copy = Particles(**{k: np.array(v) for k, v in vars(bed).items()})
        sim = Simulation(SAND, copy, 0.01, box_over(size), xpic=order)
        if order:
            before = copy.momentum
            sim._filter(order)
            np.testing.assert_allclose(copy.momentum, before, atol=1e-12)
        energies.append(copy.mass @ (copy.v**2).sum(axis=1))
    assert energies[0] > energies[1] > energies[2] > 0.0


def test_noise_dies_down_in_a_resting_bed():
    """Random velocities of 0.1 m/s are below 2 mm/s after 0.1 s; FLIP alone keeps most of them, unseen by the grid."""
    poppy, left = Material.of_density(0.56, 638.0, 3.4e5), {}
    for calm in (0.0, 0.01):
        bed, size = small_bed(2, poppy, 0.005)
        bed.v = np.random.default_rng(0).normal(scale=0.1 / math.sqrt(2.0), size=bed.v.shape)
        sim = Simulation(poppy, bed, 0.005, box_over(size), wall_friction=0.56, calm=calm)
        while sim.time < 0.1:
            sim.step()
        left[calm] = math.sqrt((bed.v**2).sum(axis=1).mean())
    assert left[0.01] < 2e-3
    assert left[0.0] > 50e-3


def test_a_layer_absorbs_waves_that_are_shorter_than_it():
    """Of a weak compression wave that is half as long, about a third comes back of what a wall sends back."""
    size, back = (0.9, 0.2), 0.9 / SAND.wave_speed
    returned = {}
    for absorb in (0.0, 0.25):
        flows = []
        for push in (0.0, 1e-3):
            bed = level_bed(SAND, size, 0.01)
            sim = Simulation(SAND, bed, 0.01, box_over(size, 0.04), absorb=[[absorb, absorb], [0.0, 0.0]])
            bed.v[:, 0] += push * np.exp(-(((bed.x[:, 0] - 0.45) / 0.03) ** 2))
            middle = []
            while sim.time < 1.1 * back:
                sim.step()
                if sim.time > 0.9 * back:
                    near = np.abs(sim.particles.x[:, 0] - 0.45) < 0.05
                    middle.append(sim.particles.v[near, 0].mean())
            flows.append(np.array(middle))
        returned[absorb] = np.abs(flows[1] - flows[0]).max()
    assert returned[0.0] > 2.5e-4
    assert returned[0.25] < 0.35 * returned[0.0]


def test_what_cannot_be():
    bed, size = small_bed(2)
    with pytest.raises(MpmError, match="whole cells"):
        level_bed(SAND, (0.205, 0.1), 0.01)
    with pytest.raises(MpmError, match="at least 4 cells"):
        Simulation(SAND, bed, 0.1, size)
    with pytest.raises(MpmError, match="too thin"):
        Simulation(SAND, bed, 0.01, box_over(size), bodies=[Body(box(0.1, 0.008), np.array([0.1, 0.15]), np.zeros(2))])
    with pytest.raises(MpmError, match="outside the box"):
        Simulation(SAND, bed, 0.01, (0.1, 0.2))
