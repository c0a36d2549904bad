"""The step of `rftsim-mpm bench` in Taichi, on one thread of a CPU and in float64: which of the two is faster.

Taichi is no dependency; it has an environment of its own (tried: taichi 1.7.4 on Python 3.11):

    python3 -m venv /tmp/taichi && /tmp/taichi/bin/pip install taichi
    rftsim-mpm bench --processes 1 --json > ours.json
    /tmp/taichi/bin/python tests/peers/taichi_step.py ours.json

Explicit plane strain as Taichi's own examples write it: a bed under gravity and a plate that moves down, quadratic
B-splines, elastic trial with the spin's rotation, Drucker-Prager without dilation, walls, and the plate's velocity set
at the nodes inside it. Particles stand in the order of cells, as ours do.
"""

import argparse
import json
import math
import time
from pathlib import Path

import numpy as np
import taichi as ti

DX, SIZE, TOP, PPC = 2.5e-3, (0.6, 0.25), 0.3, 2
"""Those of `rftsim-mpm bench` in the plane."""
MU, RHO, YOUNG, POISSON = 0.4, 1512.0, 1e6, 0.3
PLATE, SPEED, FRICTION = (0.05, 0.015), 0.1, 0.35
G, K = YOUNG / (2.0 * (1.0 + POISSON)), YOUNG / (3.0 * (1.0 - 2.0 * POISSON))
DT = 0.3 * DX / math.sqrt((K + 4.0 / 3.0 * G) / RHO)

ti.init(arch=ti.cpu, default_fp=ti.f64, cpu_max_num_threads=1)
H = DX / PPC
COUNT = round(SIZE[0] / H) * round(SIZE[1] / H)
CELLS = round(SIZE[0] / DX) + 3, round(TOP / DX) + 3
place, velocity = ti.Vector.field(2, ti.f64, COUNT), ti.Vector.field(2, ti.f64, COUNT)
stress = ti.Vector.field(4, ti.f64, COUNT)  # xx, yy, zz, xz
volume, density, strain = ti.field(ti.f64, COUNT), ti.field(ti.f64, COUNT), ti.field(ti.f64, COUNT)
mass = ti.field(ti.f64, CELLS)
momentum, before, force = (ti.Vector.field(2, ti.f64, CELLS) for _ in range(3))


@ti.func
def spline(x):
    """First node, weights and their slopes of quadratic B-splines."""
    base = ti.cast(x / DX - 0.5, ti.i32)
    f = x / DX - ti.cast(base, ti.f64)
    w = ti.Matrix.rows([0.5 * (1.5 - f) ** 2, 0.75 - (f - 1.0) ** 2, 0.5 * (f - 0.5) ** 2])
    s = ti.Matrix.rows([f - 1.5, 2.0 - 2.0 * f, f - 0.5]) / DX
    return base, w, s


@ti.kernel
def scatter():
    for p in place:
        base, w, s = spline(place[p])
        t, m = stress[p], RHO * H**2
        for i, j in ti.static(ti.ndrange(3, 3)):
            weight = w[i, 0] * w[j, 1]
            slope = ti.Vector([s[i, 0] * w[j, 1], w[i, 0] * s[j, 1]])
            node = base + ti.Vector([i, j])
            mass[node] += weight * m
            momentum[node] += weight * m * velocity[p]
            force[node] -= volume[p] * ti.Vector([t[0] * slope[0] + t[3] * slope[1], t[3] * slope[0] + t[2] * slope[1]])


@ti.kernel
def move(bottom: ti.f64):
    for i, j in mass:
        m = mass[i, j]
        if m > 0.0:
            v = momentum[i, j] / m
            before[i, j] = v
            v += DT * (force[i, j] / m + ti.Vector([0.0, -9.81]))
            x, z = (i - 1) * DX - 0.5 * SIZE[0], j * DX
            if abs(x) < 0.5 * PLATE[0] and z > bottom and z < bottom + PLATE[1]:
                push = -SPEED - v[1]
                if push < 0.0:
                    v[1] = -SPEED
                    v[0] -= ti.max(-FRICTION * -push, ti.min(FRICTION * -push, v[0]))
            if i <= 1 or i >= CELLS[0] - 2:
                v[0] = 0.0
            if j <= 1:
                v[1] = ti.max(v[1], 0.0)
            momentum[i, j] = v


@ti.kernel
def gather():
    for p in place:
        base, w, s = spline(place[p])
        now, change = ti.Vector([0.0, 0.0]), ti.Vector([0.0, 0.0])
        slope = ti.Matrix([[0.0, 0.0], [0.0, 0.0]])
        for i, j in ti.static(ti.ndrange(3, 3)):
            weight = w[i, 0] * w[j, 1]
            node = base + ti.Vector([i, j])
            v = momentum[node]
            now += weight * v
            change += weight * (v - before[node])
            slope += v.outer_product(ti.Vector([s[i, 0] * w[j, 1], w[i, 0] * s[j, 1]]))
        place[p] += DT * now
        velocity[p] += change
        growth = DT * (slope[0, 0] + slope[1, 1])
        volume[p] *= ti.exp(growth)
        density[p] *= ti.exp(-growth)
        shear, turn = 0.5 * DT * (slope[0, 1] + slope[1, 0]), 0.5 * DT * (slope[0, 1] - slope[1, 0])
        t, third = stress[p], growth / 3.0
        pressure = -(t[0] + t[1] + t[2]) / 3.0 - K * growth
        old = (t[0] + t[1] + t[2]) / 3.0
        xx = t[0] - old + 2.0 * turn * t[3] + 2.0 * G * (DT * slope[0, 0] - third)
        yy = t[1] - old - 2.0 * G * third
        zz = t[2] - old - 2.0 * turn * t[3] + 2.0 * G * (DT * slope[1, 1] - third)
        xz = t[3] + turn * (t[2] - t[0]) + 2.0 * G * shear
        tau = ti.sqrt(0.5 * (xx * xx + yy * yy + zz * zz) + xz * xz)
        share = 1.0
        if pressure <= 0.0 or density[p] < RHO:
            pressure, share = 0.0, 0.0
        elif tau > MU * pressure:
            share = MU * pressure / tau
        strain[p] += (1.0 - share) * tau / G
        stress[p] = share * ti.Vector([xx, yy, zz, xz]) - pressure * ti.Vector([1.0, 1.0, 1.0, 0.0])


def fill() -> None:
    """A bed at rest, its particles in the order of cells."""
    cells = np.stack(np.meshgrid(*(np.arange(round(s / DX)) for s in SIZE), indexing="ij"), axis=-1).reshape(-1, 1, 2)
    inside = (np.stack(np.meshgrid(*[np.arange(PPC)] * 2, indexing="ij"), axis=-1).reshape(1, -1, 2) + 0.5) / PPC
    x = ((cells + inside) * DX).reshape(-1, 2)
    pressure = RHO * 9.81 * (SIZE[1] - x[:, 1])
    place.from_numpy(x + DX)  # a row of nodes outside
    stress.from_numpy(np.column_stack([-pressure] * 3 + [0.0 * pressure]))
    volume.fill(H**2)
    density.from_numpy(RHO * (1.0 + pressure / K))


def run(steps: int, done: int) -> float:
    """Steps, and the processor's time that they took [s], which other processes lengthen less than the clock's."""
    began = time.process_time()
    for step in range(done, done + steps):
        for grid in (mass, momentum, force):
            grid.fill(0.0)
        scatter()
        move(DX + SIZE[1] - 0.01 - SPEED * DT * step)
        gather()
    ti.sync()
    return time.process_time() - began


def main() -> None:
    """Measure as `rftsim-mpm bench` does, and print the ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ours", type=Path, help="what `rftsim-mpm bench --json` printed")
    parser.add_argument("--json", action="store_true", help="print JSON")
    chosen = parser.parse_args()
    ours = json.loads(chosen.ours.read_text())["2d"]["updates_per_s"]
    fill()
    run(80, 0)
    taichi = 80 * COUNT / min(run(80, 80 * i) for i in range(1, 6))
    if not np.isfinite(place.to_numpy()).all() or np.abs(velocity.to_numpy()).max() > 10.0 * SPEED:
        raise SystemExit("the sand in Taichi did not stay in its box")
    if chosen.json:
        print(json.dumps({"particles": COUNT, "ours": ours, "taichi": taichi, "ratio": ours / taichi}))
    else:
        print(f"{COUNT} particles, updates/s: ours {ours:.3g}, Taichi {taichi:.3g}; ratio {ours / taichi:.2f}")


if __name__ == "__main__":
    main()
