"""The plate of `rftsim-mpm plate` in Newton's implicit MPM, a peer that shares nothing with ours but the law.

Newton is no dependency; it has an environment of its own (tried: newton 1.8.0, warp-lang 1.19.0, on a CPU):

    python3 -m venv /tmp/newton && /tmp/newton/bin/pip install newton
    rftsim-mpm plate --json > ours.json
    /tmp/newton/bin/python tests/peers/newton_plate.py ours.json

It pushes the flat plate of ours.json down, through the same bed with as many particles per cell and axis. Newton's sand
is rigid-plastic, sqrt(s:s/2) <= mu p without dilation: NDPM in the limit of infinite stiffness. It is solved in space,
so plane strain is a slab of a few cells between two smooth walls. A node of Newton's knows one collider, the deepest,
so sand slips out sideways where the plate meets a wall, and only the middle cell of the slab is read.
"""

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any, NamedTuple

import newton
import numpy as np
import warp as wp
from newton.solvers import SolverImplicitMPM

BED = 8.6, 3.1
"""Width and height, in lengths of the plate: those of `rftsim-mpm plate` at mu 0.4."""
SETTLING = 4
"""Steps before the plate moves, which let the weight arrive at the bottom: the solver stops at so many iterations."""


class Reading(NamedTuple):
    """As `rftsim-mpm plate --json` has it."""

    force: float
    """Of the middle cell of the slab, per width [N/m]."""
    noise: float
    """Standard deviation of the steps about a line, relative [-]."""
    particles: int
    steps: int
    seconds: float
    """Of the processor; Newton takes one thread."""


def scene(ours: dict[str, Any], dx: float, slab: int) -> tuple[newton.Model, np.ndarray]:
    """Bed, walls and plate, and the bed's size (3,) [m]."""
    length, spacing = ours["length"], dx / ours["ppc"]
    size = np.array([round(BED[0] * length / dx), slab, round(BED[1] * length / dx)]) * dx
    axes = [spacing * (np.arange(round(s / spacing)) + 0.5) for s in size]
    place = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    n = len(place)
    builder = newton.ModelBuilder()
    SolverImplicitMPM.register_custom_attributes(builder)
    builder.add_particles(
        pos=place.tolist(),
        vel=[(0.0, 0.0, 0.0)] * n,
        mass=[ours["rho"] * spacing**3] * n,
        radius=[0.5 * spacing] * n,
        custom_attributes={"mpm:friction": [ours["mu_int"]] * n},
    )
    smooth = newton.ModelBuilder.ShapeConfig(mu=0.0)
    for axis, upper in ((0, False), (0, True), (1, False), (1, True), (2, False)):
        half, middle = np.full(3, size.max()), 0.5 * size
        half[axis] = 4.0 * dx
        middle[axis] = size[axis] + half[axis] if upper else -half[axis]
        builder.add_shape_box(-1, xform=wp.transform(wp.vec3(*middle)), hx=half[0], hy=half[1], hz=half[2], cfg=smooth)
    half = 0.5 * length, size[1], 0.5 * thickness(ours)  # wider than the slab
    top = wp.vec3(0.5 * size[0], 0.5 * size[1], size[2] + half[2])
    body = builder.add_body(xform=wp.transform(top), is_kinematic=True)
    rough = newton.ModelBuilder.ShapeConfig(mu=ours["mu_surf"])
    builder.add_shape_box(body, hx=half[0], hy=half[1], hz=half[2], cfg=rough)
    return builder.finalize(device="cpu"), size


def thickness(ours: dict[str, Any]) -> float:
    """Of a plate in the plane [m]."""
    return ours["thickness"] or 0.3 * ours["length"]


def push(ours: dict[str, Any], dx: float, slab: int, share: float, iterations: int) -> Reading:
    """Push the plate to a little beyond the reading, by a share of a cell in each step."""
    model, size = scene(ours, dx, slab)
    state = model.state()
    solver = SolverImplicitMPM(model, SolverImplicitMPM.Config(voxel_size=dx, max_iterations=iterations))
    solver.setup_collider()
    bodies = solver.collider_body_index.numpy()
    speed, depth, window = ours["speed"], ours["depth_m"], 0.05 * ours["length"]
    dt, steps = share * dx / speed, math.ceil((depth + window) / (share * dx))
    middle, travel, rows = 0.5 * size[1], 0.0, []
    began = time.process_time()
    for step in range(SETTLING + steps):
        moving = step >= SETTLING
        state.body_qd.assign(np.array([[0.0, 0.0, -speed * moving, 0.0, 0.0, 0.0]], np.float32))
        solver.step(state, state, None, None, dt)
        travel += speed * moving * dt
        pose = state.body_q.numpy()
        pose[0, 2] = size[2] + 0.5 * thickness(ours) - travel
        state.body_q.assign(pose)
        solver.project_outside(state, state, dt)
        impulse, where, collider = (array.numpy() for array in solver.collect_collider_impulses(state))
        on_plate = (collider >= 0) & (bodies[collider] >= 0)
        # Of the nodes on the two planes that bound the middle cell, the other half is the neighbours'.
        part = np.clip(0.5 + (0.5 * dx - np.abs(where[on_plate, 1] - middle)) / (0.01 * dx), 0.0, 1.0)
        rows.append([travel - 0.5 * share * dx, part @ impulse[on_plate, 2] / dt / dx])
    seconds = time.process_time() - began
    way, force = np.array(rows).T
    near = np.abs(way - depth) <= window
    line = np.polyfit(way[near] - depth, force[near], 1)
    rest = force[near] - np.polyval(line, way[near] - depth)
    return Reading(float(line[1]), float(rest.std() / line[1]), model.particle_count, len(rows), seconds)


def main() -> None:
    """Measure, and print both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ours", type=Path, nargs="+", help="what `rftsim-mpm plate --json` printed")
    parser.add_argument("--slab", type=int, default=3, help="width of the slab [cells], odd")
    parser.add_argument("--share", type=float, default=0.1, help="the plate's way in one time step [cells]")
    parser.add_argument("--iterations", type=int, default=250, help="of the solver in a step, at most")
    parser.add_argument("--json", action="store_true", help="print JSON")
    chosen = parser.parse_args()
    found = []
    for path in chosen.ours:
        ours = json.loads(path.read_text())
        dx = ours["length"] / ours["cells"]
        if ours["dim"] != 2 or ours["beta"] or ours["gamma"] != 90.0 or chosen.slab % 2 == 0:
            parser.error(f"{path} must be of a flat plate pushed straight down in the plane, and --slab odd")
        reading = push(ours, dx, chosen.slab, chosen.share, chosen.iterations)
        own = {name: ours[name] for name in ("noise", "particles", "steps", "seconds")}
        found.append({"dx_m": dx, "ours": {"force": ours["force"][-1], **own}, "newton": reading._asdict()})
    if chosen.json:
        print(json.dumps(found, indent=2))
        return
    print("| dx [mm] | code | force at depth [N/m] | scatter [%] | particles | steps | time [s] |")
    print("|---|---|---:|---:|---:|---:|---:|")
    for row in found:
        for code in ("ours", "newton"):
            one = row[code]
            print(
                f"| {1e3 * row['dx_m']:g} | {code} | {one['force']:.0f} | {100 * one['noise']:.1f} "
                f"| {one['particles']} | {one['steps']} | {one['seconds']:.0f} |"
            )


if __name__ == "__main__":
    wp.config.log_level = wp.LOG_ERROR
    main()
