"""MuJoCo models that the engine's tests share."""

import mujoco
import numpy as np

from rftsim import Sand, add_sand, wrenches

SAND = Sand(xi_n=2e5, rho_c=1500.0, mu_surf=0.4)
BALL = '<body name="ball" pos="0 0 .02"><freejoint/><geom size=".1"/></body>'
JOINTS = {
    "free": "<freejoint/>",
    "ball": '<joint type="ball" pos=".02 0 .01"/>',
    "slide": '<joint type="slide" axis="1 .3 -.2"/>',
    "hinge": '<joint type="hinge" axis=".2 1 .1" pos="0 .03 0"/>',
    "two": '<joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 1 0"/>',
    "none": "",
    "planar": '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint axis="0 1 0"/>',
    "pitch": '<joint axis="0 1 0" pos=".03 0 -.02"/>',
}


def xml(bodies, option="", extra=""):
    return f"<mujoco>{option}<worldbody>{bodies}</worldbody>{extra}</mujoco>"


def spec_of(bodies=BALL, option="", extra=""):
    return mujoco.MjSpec.from_string(xml(bodies, option, extra))


def sandy(mjcf=BALL, option="", sand=SAND, law="rft3d", force="explicit", **options):
    """A compiled model with sand under it, whose force is that of the moment."""
    spec = spec_of(mjcf, option)
    add_sand(spec, sand, law, force=force, **{"reduction": 0.0} | options)
    return spec.compile()


def tree(rng, kinds, *, planar=False):
    """Bodies of the given joints, each hanging on an earlier one (free ones on the world), turned anyhow, or in x-z."""
    parents = [-1 if kind == "free" or i == 0 else int(rng.integers(i)) for i, kind in enumerate(kinds)]

    def body(i):
        x, y, z = rng.uniform(-0.1, 0.1, size=3)
        quat = " ".join(f"{q:.6f}" for q in rng.normal(size=4) * ((1, 0, 1, 0) if planar else 1))
        size = " ".join(f"{s:.4f}" for s in rng.uniform(0.03, 0.08, size=3))
        shape = f'<geom type="{rng.choice(["box", "ellipsoid"])}" size="{size}" pos="{x:.4f} {y:.4f} 0"/>'
        children = "".join(body(j) for j, parent in enumerate(parents) if parent == i)
        place = f'pos="{y:.4f} {z:.4f} {x - 0.08:.4f}" quat="{quat}"'
        return f'<body name="b{i}" {place}>{JOINTS[kinds[i]]}{shape}{children}</body>'

    return "".join(body(i) for i, parent in enumerate(parents) if parent < 0)


def shaken(model, seed=0, speed=1.0):
    """Data at a random state, forwarded."""
    rng, data = np.random.default_rng(seed), mujoco.MjData(model)
    data.qvel[:] = rng.normal(size=model.nv) * speed
    mujoco.mj_integratePos(model, data.qpos, rng.normal(size=model.nv) * 0.1, 1.0)
    mujoco.mj_forward(model, data)
    return data


def applied(model, data):
    """The wrenches of `rftsim.wrenches` as generalised forces, by MuJoCo's own mj_applyFT."""
    found, total = wrenches(model, data), np.zeros(model.nv)
    for body in range(1, model.nbody):
        mujoco.mj_applyFT(model, data, found.force[body], found.moment[body], data.xpos[body], body, total)
    return total


def trajectory(model, data, nstep=50):
    """Positions and sensor values, (nstep, nq + nsensordata)."""
    rows = []
    for _ in range(nstep):
        mujoco.mj_step(model, data)
        rows.append(np.concatenate([data.qpos, data.sensordata]))
    return np.array(rows)
