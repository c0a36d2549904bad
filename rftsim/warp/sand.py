"""Sand in mujoco_warp: what its step calls, and how a model with sand gets there."""

import copy
import ctypes
from typing import Any, Final, NamedTuple

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp
from mujoco_warp._src import derivative, forward, io, smooth, support
from mujoco_warp._src.types import Stage

from rftsim.engine import layout
from rftsim.errors import SceneError
from rftsim.model.readout import instances
from rftsim.warp import equation
from rftsim.warp.bed import WarpBed

ITERATIONS: Final = 3
"""Linearisations of the sand's force in a step."""
COUPLING: Final = 1e-6
"""Offset of an inertia from its body's frame by which MuJoCo no longer takes its mass matrix for a diagonal [m]."""
_INTEGRATORS: Final = (mjw.IntegratorType.EULER, mjw.IntegratorType.IMPLICIT, mjw.IntegratorType.IMPLICITFAST)


class WarpSand:
    """The sand of a model in many worlds, as callbacks of mujoco_warp.

    Attributes:
        beds: The beds of sand.
        iterations: Linearisations of the implicit force in a step, at least 1.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        nworld: int,
        iterations: int = ITERATIONS,
        onto: mujoco.MjModel | None = None,
    ) -> None:
        """Put the sand of a model on Warp's device.

        Args:
            model: A compiled model with sand.
            nworld: Number of worlds.
            iterations: Linearisations of the implicit force in a step.
            onto: The model that mujoco_warp was given, where another made it: its bodies have the names of those that
                feel the sand, and its user sensors `<body>_sand` of six numbers are filled with their wrenches.

        Raises:
            SceneError: The model has no sand, or sand that Warp does not know; or a body of it is not in the other.
        """
        found = instances(model)
        if not found:
            raise SceneError("the model has no sand: put it there with rftsim.add_sand before it is compiled")
        self.nworld, self.iterations = nworld, iterations
        self.beds = [WarpBed(model, bed, nworld, onto or model) for bed in found]
        if onto is None:
            self._sensors = [_sensors_of(model, bed.id, own.bodies) for bed, own in zip(found, self.beds, strict=True)]
        else:
            self._sensors = [_sensors_named_for(onto, own.bodies) for own in self.beds]
        model = onto or model
        shape = nworld, model.nv
        self._is_new = wp.ones(nworld, dtype=bool)
        self._smooth, self._acceleration, self._velocity = (wp.zeros(shape, dtype=float) for _ in range(3))
        self._damped, self._matrix = (wp.zeros((nworld, model.nC), dtype=float) for _ in range(2))
        blocks = io.m_block_layout(model)
        sizes = blocks["total"] + (model.nC if blocks["has_sparse"] else 0), model.nv
        self._factors = [wp.zeros((nworld, size), dtype=float) for size in sizes]

    def attach(self, m: Any) -> None:
        """Have mujoco_warp's step call this sand, beside what it calls already.

        Raises:
            SceneError: The integrator is not Euler, implicit or implicitfast; bodies may sleep; energy is computed.
        """
        if m.opt.integrator not in _INTEGRATORS:
            raise SceneError("sand on Warp needs the integrator Euler, implicit or implicitfast")
        if m.opt.enableflags & (mjw.EnableBit.SLEEP | mjw.EnableBit.ENERGY):
            raise SceneError("sand on Warp is part of the mass matrix: leave the flags sleep and energy off")
        m.callback.passive = _both(m.callback.passive, self.press)
        m.callback.sensor = _both(m.callback.sensor, self.read)

    def press(self, m: Any, d: Any) -> None:
        """Add the sand's force to the passive ones, and what it changes to the mass matrix."""
        for bed in self.beds:
            bed.begin(m, d)
        implicit = [bed for bed in self.beds if bed.is_implicit]
        iterations = self.iterations if implicit else 1
        if iterations > 1:
            self._find_drives(m, d)
        for iteration in range(iterations):
            for bed in implicit if iteration > 0 else self.beds:
                bed.evaluate(m, d)
            if iteration < iterations - 1:
                self._solve(m, d, implicit)
        for bed in self.beds:
            bed.add_force(d.qfrc_passive)
        for bed in implicit:
            bed.add_stiffness(m, d.M, d.M)

    def _find_drives(self, m: Any, d: Any) -> None:
        """Find what drives the step beside the sand, and the mass with what the integrator takes implicitly.

        Mujoco_warp does it again, the same. The constraints' force is that of the last step: it only helps to find
        where the sand's force is linearised.
        """
        forward.fwd_actuation(m, d)
        smooth.rne(m, d)
        smooth.tendon_bias(m, d, d.qfrc_bias)
        given = [d.qfrc_passive, d.qfrc_actuator, d.qfrc_applied, d.qfrc_bias, d.qfrc_constraint, self._is_new]
        wp.launch(equation.sum_smooth, dim=self._smooth.shape, inputs=given, outputs=[self._smooth])
        self._is_new.zero_()
        support.xfrc_accumulate(m, d, self._smooth)
        if m.opt.integrator == mjw.IntegratorType.EULER:
            wp.copy(self._damped, d.M)
            wp.launch(
                equation.add_damping,
                dim=self._smooth.shape,
                inputs=[m.M_rowadr, m.M_rownnz, m.dof_damping, m.opt.timestep],
                outputs=[self._damped],
            )
        else:
            derivative.deriv_smooth_vel(m, d, self._damped)

    def _solve(self, m: Any, d: Any, beds: "list[WarpBed]") -> None:
        """Go on to the velocity at which the linearised equation ends, without the rows of constraints."""
        force, matrix = self._velocity, self._damped
        wp.copy(force, self._smooth)
        for bed in self.beds:
            bed.add_force(force)
        for bed in beds:
            bed.add_stiffness(m, matrix, self._matrix)
            matrix = self._matrix
        smooth.factor_solve_i(m, d, matrix, *self._factors, self._acceleration, force)
        self._fill_velocity(m, d, self._acceleration)
        for bed in beds:
            bed.go_on(d, self._velocity)

    def _fill_velocity(self, m: Any, d: Any, acceleration: Any) -> None:
        wp.launch(
            equation.end_of_step,
            dim=self._velocity.shape,
            inputs=[d.qvel, acceleration, m.opt.timestep],
            outputs=[self._velocity],
        )

    def read(self, m: Any, d: Any, stage: Any) -> None:
        """Fill the wrench sensors, at the stage of accelerations."""
        if stage != Stage.ACC or not any(sensors is not None for sensors in self._sensors):
            return
        self._fill_velocity(m, d, d.qacc)
        for bed, sensors in zip(self.beds, self._sensors, strict=True):
            if sensors is not None:
                wp.launch(
                    equation.read_wrenches,
                    dim=(self.nworld, sensors.shape[0]),
                    inputs=[bed.find_wrenches(self._velocity), sensors],
                    outputs=[d.sensordata],
                )

    def wrenches(self, d: Any) -> list[Any]:
        """The sand's wrenches in the step that led to data.

        Returns:
            Of each bed an array of Warp, (nworld, nbody) of spatial vectors for its `bodies`: force [N], then moment
            about the body's origin [N m], world axes. It is written anew by the next call.
        """
        return [bed.find_wrenches(d.qvel) for bed in self.beds]

    def reset(self, reset: Any = None) -> None:
        """Forget the past of worlds: call it beside `mujoco_warp.reset_data`.

        Args:
            reset: Which worlds, (nworld,) of bool; all unless given.
        """
        which = wp.ones(self.nworld, dtype=bool) if reset is None else reset
        wp.launch(equation.mark_new, dim=self.nworld, inputs=[which], outputs=[self._is_new])
        for bed in self.beds:
            bed.forget(which)


class Worlds(NamedTuple):
    """Many worlds of a model with sand."""

    m: Any
    """mujoco_warp's model, whose steps call the sand."""
    d: Any
    """Its data."""
    sand: WarpSand
    plain: mujoco.MjModel
    """The model without the plugin, as mujoco_warp takes it."""


def put(
    scene: "mujoco.MjSpec | mujoco.MjModel",
    data: mujoco.MjData | None = None,
    *,
    nworld: int = 1,
    iterations: int = ITERATIONS,
    **sizes: Any,
) -> Worlds:
    """Put a model with sand into many worlds of mujoco_warp.

    Args:
        scene: A spec that `rftsim.add_sand` was given, or a compiled model with sand.
        data: Where the worlds start; the model's reset state unless given.
        nworld: Number of worlds.
        iterations: Linearisations of the implicit force in a step, at least 1.
        **sizes: What `mujoco_warp.put_data` takes beside: nconmax, njmax, ...

    Raises:
        SceneError: The model has no sand, or sand that Warp does not know; or its integrator is not supported.
    """
    model = compile_coupled(scene) if isinstance(scene, mujoco.MjSpec) else scene
    sand = WarpSand(model, nworld, iterations)
    plain = without_plugin(model)
    m = mjw.put_model(plain)
    if data is None:
        data = mujoco.MjData(plain)
        mujoco.mj_forward(plain, data)
    d = mjw.put_data(plain, data, nworld=nworld, **sizes)
    sand.attach(m)
    return Worlds(m, d, sand, plain)


def compile_coupled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a spec so that its mass matrix has entries for all that the sand couples.

    MuJoCo keeps the diagonal alone of a free body whose inertia is that of its own frame. An offset of a micrometre
    makes it keep all.
    """
    own = spec.copy()
    model = own.compile()
    for body in own.bodies[1:]:
        i = model.body(body.name).id if body.name else -1
        if i >= 0 and model.body_simple[i] and model.body_dofnum[i] > 1:
            body.explicitinertial = True
            body.mass, body.iquat, body.inertia = model.body_mass[i], model.body_iquat[i], model.body_inertia[i]
            body.ipos = model.body_ipos[i] + np.array([COUPLING, 0.0, 0.0])
    return own.compile()


def without_plugin(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy of a model that knows no plugin; sensors of plugins become sensors of the user's.

    Mujoco_warp takes no model whose number of plugins is not nought, which only MuJoCo's own struct can say.
    """
    plain = copy.copy(model)
    plain.body_plugin[:] = -1
    ours = plain.sensor_plugin >= 0
    plain.sensor_type[ours] = mujoco.mjtSensor.mjSENS_USER
    plain.sensor_plugin[:] = -1
    places = layout.layout()[0]
    for offset in (places.nplugin, places.npluginattr, places.npluginstate):
        ctypes.c_int64.from_address(plain._address + offset).value = 0
    return plain


def _sensors_of(model: mujoco.MjModel, instance: int, bodies: "list[int]") -> Any:
    """First number and body of each sensor of a bed's wrenches, (nsensor, 2), on the device; None where it has none."""
    found = [
        (int(model.sensor_adr[i]), bodies.index(int(model.sensor_objid[i])))
        for i in np.flatnonzero(model.sensor_plugin == instance)
        if int(model.sensor_objid[i]) in bodies
    ]
    return wp.array(np.array(found), dtype=int) if found else None


def _sensors_named_for(model: mujoco.MjModel, bodies: "list[int]") -> Any:
    """The same of the user sensors that are named for the wrench on a body."""
    names = [f"{model.body(body).name}_sand" for body in bodies]
    found = [
        (int(model.sensor_adr[i]), names.index(model.sensor(i).name))
        for i in np.flatnonzero((model.sensor_type == mujoco.mjtSensor.mjSENS_USER) & (model.sensor_dim == 6))
        if model.sensor(i).name in names
    ]
    return wp.array(np.array(found), dtype=int) if found else None


def _both(first: Any, second: Any) -> Any:
    """What calls two callbacks in turn, of which the first may be none."""
    if first is None:
        return second

    def call(*arguments: Any) -> None:
        first(*arguments)
        second(*arguments)

    return call
