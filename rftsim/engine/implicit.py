"""The sand's force at the end of the step, from what MuJoCo knows when it computes passive forces.

At that moment the mass matrix and the constraints' Jacobians are current, and what drives the step is not: actuation,
bias and the constraints' reference are the last step's. They are computed here (MuJoCo does it again, the same). Each
island of bodies that has one near the sand is then solved for alone, see `islands`; all else costs a bounding test.
"""

from typing import Final

from rftsim.engine import bodies, constraints, external, instance, islands
from rftsim.engine.layout import CONSTANTS
from rftsim.engine.refusals import WHY
from rftsim.law import exports
from rftsim.law.body import bed_of, header_at
from rftsim.machine.compiling import inline
from rftsim.machine.memory import doubles, int32s, peek, pointer, poke, release, stack_doubles, take
from rftsim.solver import equation, linear_algebra, matrices, pattern, state, time_step
from rftsim.solver.equation import TABLE, WORK
from rftsim.solver.motion import size_of
from rftsim.solver.sinking import is_near

_UNDAMPED: Final = CONSTANTS["no_euler_damping"] | CONSTANTS["no_damping"]
_EULER: Final = CONSTANTS["euler"]
_IMPLICIT: Final = CONSTANTS["implicit"]
_ISLANDS: Final = islands.TABLE
_SAND: Final = instance.SAND_NUMBERS
_WORK: Final = len(WORK.names or ())


@inline
def _find_near(model, m, t, address, sand, old, out):
    """Fill out with the places of the bodies that can be in the sand within the step, or last had their step split."""
    found = 0
    nv, h = pointer(m + model.nv), doubles(m + model.opt_timestep, 1)[0]
    twist = doubles(stack_doubles(6), 6)
    for k in range(instance.head(address).nbody):
        body, surface = instance.body(address, k), instance.surface(model, m, address, k)
        bodies.twist(t, body, twist[:3], twist[3:])
        speed = size_of(twist, 2.0 * header_at(surface).gyration)
        xpos, xmat = t.xpos[3 * body : 3 * body + 3], t.xmat[9 * body : 9 * body + 9]
        is_split = state.kept_at(state.kept(old, nv, k)).drift > 0.0
        if is_split or is_near(sand, surface, xpos, xmat, speed, h):
            out[found] = k
            found += 1
    return found


@inline
def _fill_smooth_force(model, data, m, d, t, out):
    """Fill all smooth forces of this step but the sand's, (nv,)."""
    bias, nv = pointer(d + data.qfrc_bias), out.size
    external.rne(m, d, 0, bias)
    passive, actuator = doubles(pointer(d + data.qfrc_passive), nv), doubles(pointer(d + data.qfrc_actuator), nv)
    applied, weight = doubles(pointer(d + data.qfrc_applied), nv), doubles(bias, nv)
    for i in range(nv):
        out[i] = passive[i] + actuator[i] + applied[i] - weight[i]
    nbody = t.parent.size
    wrench, at = doubles(pointer(d + data.xfrc_applied), 6 * nbody), doubles(pointer(d + data.xipos), 3 * nbody)
    for body in range(1, nbody):
        f = wrench[6 * body : 6 * body + 6]
        any_force = False
        for k in range(6):
            any_force = any_force or f[k] != 0.0
        if any_force:
            x = at[3 * body : 3 * body + 3]
            bodies.add_wrench(t, body, x, (f[0], f[1], f[2]), (f[3], f[4], f[5]), out)


@inline
def _sort(model, data, m, d, t, address, i):
    """Fill the table of islands: the near bodies are there already, and the passive forces are without the sand's."""
    nv = islands.head(i).nv
    tree = int32s(pointer(m + model.dof_treeid), nv)
    constraints.join_trees(model, data, m, d, i)
    for k in range(islands.head(i).nbody):
        dof = bodies.last_dof(t, instance.body(address, islands.near(i)[k]))
        islands.island_of_body(i)[k] = tree[dof] if dof >= 0 else islands.NONE
    islands.sort(i, tree)


@inline
def _compute_drives(model, data, m, d, t, i):
    """Have MuJoCo compute what drives the step: actuation, the derivatives of drag, the rows' reference, the bias."""
    if pointer(m + model.nu) > 0:
        external.fwd_actuation(m, d)  # before the drag, which leaves out actuators at their limits
    integrator = int32s(m + model.opt_integrator, 1)[0]
    if integrator != _EULER:
        external.smooth_vel(m, d, 1 if integrator == _IMPLICIT else 0)
    if islands.head(i).nrow > 0:
        external.reference_constraint(m, d)
    _fill_smooth_force(model, data, m, d, t, islands.smooth_force(i))


@inline
def _couple_trees(t, i, island, p):
    """Couple what the trees of an island couple; constraints may couple more."""
    place, dofs, first = islands.place_of(i), islands.dofs(i), islands.dof_start(i)[island]
    pattern.begin(p)
    for k in range(first, first + islands.dof_count(i)[island]):
        above = t.dof_parent[dofs[k]]
        if above >= 0:
            pattern.couple(p, place[dofs[k]], place[above])


@inline
def _fill_bodies(model, m, t, address, old, i, island, p):
    """Fill the bodies of an island's equation."""
    nv, place, first = islands.head(i).nv, islands.place_of(i), islands.body_start(i)[island]
    sand, v, w = equation.head(p).sand, doubles(stack_doubles(3), 3), doubles(stack_doubles(3), 3)
    for b in range(equation.head(p).nbody):
        k = islands.near(i)[islands.members(i)[first + b]]
        body, surface = instance.body(address, k), instance.surface(model, m, address, k)
        equation.surface(p)[b], equation.length(p)[b] = surface, header_at(surface).gyration
        r, f, path, n = equation.rotation(p, b), equation.frame(p, b), equation.path(p, b), 0
        dof = bodies.last_dof(t, body)
        while dof >= 0:
            n, dof = n + 1, t.dof_parent[dof]
        equation.path_length(p)[b] = n
        dof = bodies.last_dof(t, body)
        for at in range(n - 1, -1, -1):
            path[at] = place[dof]
            bodies.motion_by(t, body, dof, equation.motion(p, b, at))
            dof = t.dof_parent[dof]
        linear_algebra.copy(t.xmat[9 * body : 9 * body + 9], r)
        bodies.twist(t, body, v, w)
        x = t.xpos[3 * body : 3 * body + 3].ctypes.data
        exports.frame(sand, surface, x, r.ctypes.data, v.ctypes.data, w.ctypes.data, f.ctypes.data)
        linear_algebra.copy(
            doubles(state.kept(old, nv, k), state.KEPT_NUMBERS),
            doubles(equation.kept_address(p, b), state.KEPT_NUMBERS),
        )
        numbers, kept = equation.numbers(p), equation.kept(p, b)
        numbers.drift, numbers.parts = max(numbers.drift, kept.drift), max(numbers.parts, kept.parts)


@inline
def _fill_mass(model, data, m, d, i, island, p):
    """Fill the mass matrix of an island, from its lower triangle in rows; its pattern is there."""
    nv, place, dofs, first = islands.head(i).nv, islands.place_of(i), islands.dofs(i), islands.dof_start(i)[island]
    number, start = int32s(pointer(m + model.M_rownnz), nv), int32s(pointer(m + model.M_rowadr), nv)
    total = start[nv - 1] + number[nv - 1]
    column, value = int32s(pointer(m + model.M_colind), total), doubles(pointer(d + data.M), total)
    out, n = equation.plain_mass(p), equation.head(p).ndof
    matrices.clear(p, out)
    for k in range(n):
        out[(n + 1) * k] = 1.0
    for k in range(first, first + islands.dof_count(i)[island]):
        dof, at = dofs[k], place[dofs[k]]
        for entry in range(start[dof], start[dof] + number[dof]):
            other, inertia = peek(place, peek(column, entry)), peek(value, entry)
            poke(out, n * at + other, inertia)
            poke(out, n * other + at, inertia)


@inline
def _fill_drag(model, data, m, d, i, island, p):
    """Fill the drag that the integrator takes implicitly, over the time step, and whether there is any."""
    nv, place, dofs, first = islands.head(i).nv, islands.place_of(i), islands.dofs(i), islands.dof_start(i)[island]
    out, numbers, integrator = equation.drag(p), equation.numbers(p), int32s(m + model.opt_integrator, 1)[0]
    matrices.clear(p, out)
    numbers.dragged, n = 0.0, equation.head(p).ndof
    if integrator == _EULER:
        if int32s(m + model.opt_disableflags, 1)[0] & _UNDAMPED == 0:
            damping = doubles(pointer(m + model.dof_damping), nv)
            for k in range(first, first + islands.dof_count(i)[island]):
                out[(n + 1) * place[dofs[k]]] = damping[dofs[k]]
                numbers.dragged = 1.0 if damping[dofs[k]] != 0.0 else numbers.dragged
        return
    number, start = int32s(pointer(m + model.D_rownnz), nv), int32s(pointer(m + model.D_rowadr), nv)
    total, is_dragged = start[nv - 1] + number[nv - 1], False
    column, value = int32s(pointer(m + model.D_colind), total), doubles(pointer(d + data.qDeriv), total)
    for k in range(first, first + islands.dof_count(i)[island]):
        dof, at = dofs[k], place[dofs[k]]
        for entry in range(start[dof], start[dof] + number[dof]):
            j, drag = peek(column, entry), -peek(value, entry)
            is_dragged = is_dragged or drag != 0.0
            if integrator == _IMPLICIT or j == dof:
                poke(out, n * at + peek(place, j), drag)
            elif j < dof:  # implicitfast takes the lower triangle for both
                poke(out, n * at + peek(place, j), drag)
                poke(out, n * peek(place, j) + at, drag)
    numbers.dragged = 1.0 if is_dragged else 0.0


@inline
def _fill_dofs(model, data, m, d, old, i, island, p):
    """Fill what an island's equation has of each degree of freedom, and its matrices; rows and bodies are there."""
    nv, dofs, first = islands.head(i).nv, islands.dofs(i), islands.dof_start(i)[island]
    velocity, lacking = doubles(pointer(d + data.qvel), nv), state.lacking(old, nv)
    light, smooth = doubles(pointer(m + model.dof_invweight0), nv), islands.smooth_force(i)
    for at in range(equation.head(p).ndof):
        equation.velocity(p)[at] = equation.lacking(p)[at] = equation.smooth_force(p)[at] = 0.0
        equation.lightness(p)[at] = 1.0
    for k in range(first, first + islands.dof_count(i)[island]):
        dof, at = dofs[k], islands.place_of(i)[dofs[k]]
        equation.velocity(p)[at], equation.lacking(p)[at] = velocity[dof], lacking[dof]
        equation.lightness(p)[at], equation.smooth_force(p)[at] = light[dof], smooth[dof]
    pattern.find(p)
    _fill_mass(model, data, m, d, i, island, p)
    _fill_drag(model, data, m, d, i, island, p)
    if equation.head(p).nrow > 0 and equation.numbers(p).dragged > 0.0:
        matrices.copy(p, equation.plain_mass(p), equation.plain_factors(p))
        matrices.factor(p, equation.plain_factors(p))


@inline
def _hand_over(model, data, m, d, address, new, i, island, p):
    """Add an island's force to MuJoCo's passive ones, and keep what must last."""
    nv, dofs, first = islands.head(i).nv, islands.dofs(i), islands.dof_start(i)[island]
    force, lacking, after = doubles(pointer(d + data.qfrc_passive), nv), state.lacking(new, nv), state.after(new, nv)
    for k in range(first, first + islands.dof_count(i)[island]):
        dof, at = dofs[k], islands.place_of(i)[dofs[k]]
        force[dof] += equation.out(p)[at]
        lacking[dof], after[dof] = equation.lacking(p)[at], equation.after(p)[at]
    first = islands.body_start(i)[island]
    for b in range(equation.head(p).nbody):
        k = islands.near(i)[islands.members(i)[first + b]]
        linear_algebra.copy(equation.wrench(p, b), instance.wrench(address, k))
        linear_algebra.copy(
            doubles(equation.kept_address(p, b), state.KEPT_NUMBERS),
            doubles(state.kept(new, nv, k), state.KEPT_NUMBERS),
        )


@inline
def _solve(model, data, contact, m, d, t, address, sand, old, new, i, island):
    """Solve for the sand's force on one island; whether there was memory to do so."""
    p, work = stack_doubles(TABLE), doubles(stack_doubles(_WORK), _WORK)
    linear_algebra.clear(work)
    counts = islands.body_count(i)[island], islands.place(i, island, t.dof_parent), islands.row_count(i)[island]
    memory = take(equation.lay_out(p, counts[0], counts[1], counts[2]))
    if memory == 0:
        return False
    equation.place(p, memory)
    head, numbers = equation.head(p), equation.numbers(p)
    head.sand, head.work = sand, work.ctypes.data
    bed = bed_of(sand)
    numbers.tolerance, numbers.iterations = bed.tolerance, bed.iterations
    numbers.drift = numbers.parts = 0.0
    numbers.timestep, numbers.started = doubles(m + model.opt_timestep, 1)[0], state.started(old)[0]
    _couple_trees(t, i, island, p)
    _fill_bodies(model, m, t, address, old, i, island, p)
    constraints.fill_rows(model, data, contact, m, d, i, island, p)
    _fill_dofs(model, data, m, d, old, i, island, p)
    for unknown in (equation.out(p), equation.after(p), equation.all_wrenches(p)):
        instance.leave_open(unknown)  # what a step that fails leaves is not taken for a force
    time_step.step(p)
    _hand_over(model, data, m, d, address, new, i, island, p)
    instance.add_work(address, work, counts[0] / islands.head(i).nbody)
    release(memory)
    return True


@inline
def press(model, data, contact, m, d, number):
    """Solve for the sand's force at the end of the step and add it to qfrc_passive."""
    address = instance.block_of(model, data, m, d, number)
    if address == 0 or instance.is_sound(m, address, instance.needed_state(model, m, address)) == 0:
        instance.spoil(model, data, m, d, number, address, WHY.changed)
        return
    nv, nbody, nrow = pointer(m + model.nv), instance.head(address).nbody, int32s(d + data.nefc, 1)[0]
    lasting, wrenches = instance.lasting(address), instance.all_wrenches(address)
    old, new = lasting.ctypes.data, instance.pending(address, lasting.size)
    linear_algebra.clear(wrenches)
    linear_algebra.clear(new)
    state.started(new.ctypes.data)[0] = 1.0
    instance.count(address, 0.0)
    t, i = bodies.tree(model, data, m, d), stack_doubles(_ISLANDS)
    memory = take(islands.lay_out(i, pointer(m + model.ntree), nv, nbody, nrow))
    if memory == 0:
        instance.spoil(model, data, m, d, number, address, WHY.exhausted)
        return
    islands.begin(i, memory)
    sand = stack_doubles(_SAND)
    instance.fill_sand(model, m, address, sand)
    found = _find_near(model, m, t, address, sand, old, islands.near(i))
    islands.head(i).nbody = found
    if found > 0:
        _sort(model, data, m, d, t, address, i)
        _compute_drives(model, data, m, d, t, i)
        for island in range(islands.head(i).ntree):
            if islands.body_count(i)[island] > 0 and not _solve(
                model, data, contact, m, d, t, address, sand, old, new.ctypes.data, i, island
            ):
                instance.spoil(model, data, m, d, number, address, WHY.exhausted)
    release(memory)
