"""A bed of sand in the worlds of mujoco_warp: its arrays, and the launches that make its force."""

from typing import Any, Final

import mujoco
import warp as wp

from rftsim.engine import plugin
from rftsim.errors import SceneError
from rftsim.law import layout
from rftsim.law.laws import CUBIC, QUARTIC, RESPONSES, Response
from rftsim.law.tables import TABLE_C3, TABLE_C4
from rftsim.model.readout import Instance
from rftsim.warp import equation, guess, linear
from rftsim.warp.definite import mat66
from rftsim.warp.force import PARTS, Kernels, kernels_of
from rftsim.warp.frames import Sands, State
from rftsim.warp.surfaces import put_paths, put_surfaces
from rftsim.warp.wheel_drop import find_drop

PARAMETERS: Final = ("xi_n", "zeta", "mu_surf", "lambda_", "rho_c", "g", "offset")
"""Numbers of the sand that may differ from world to world."""
_kernels: dict[tuple[Response, tuple[tuple[float, ...], ...]], Kernels] = {}
"""The kernels of each response and table that was asked for."""


class WarpBed:
    """A bed of sand in many worlds.

    Attributes:
        name: Its name in the model.
        is_implicit: Whether its force is that at the end of the step.
        bodies: Ids of the bodies that feel it.
        sands: Its sand, arrays of Warp by the names of PARAMETERS, one number for each world or one for all.
    """

    def __init__(self, model: mujoco.MjModel, bed: Instance, nworld: int, onto: mujoco.MjModel) -> None:
        """Put a bed of a model on the device, for a model with the same bodies, which may be the same.

        Raises:
            SceneError: Its surface is a terrain or remembers ruts, which only the engine plugin knows; or a body that
                feels it is missing.
        """
        packed = bed.bed
        if packed.relief or packed.rows:
            raise SceneError(
                f"bed {bed.name!r}: on Warp the free surface is a plane without ruts: leave out terrain= and ruts="
            )
        self.name, self.nworld = bed.name, nworld
        self.bodies = list(bed.bodies) if onto is model else [_counterpart(model, body, onto) for body in bed.bodies]
        self.is_implicit = model.plugin[bed.id] == plugin.register(plugin.IMPLICIT)
        self._kernels = _kernels_for(packed)
        self._surfaces, self._nlane = put_surfaces(dict(zip(self.bodies, bed.bodies.values(), strict=True)))
        self._paths = put_paths(onto, self.bodies)
        self.sands = _put_sands(packed)
        radii = [layout.record(surface, layout.HEADER).wheel_radius for surface in bed.bodies.values()]
        self._has_wheels = bool(packed.dynamic) and any(radius > 0.0 for radius in radii)
        self._state, self._model = _make_state(nworld, len(bed.bodies), self._nlane, self._paths)
        self._wrenches = wp.zeros(self._over_bodies, dtype=wp.spatial_vector)

    def vary(self, *names: str) -> None:
        """Give parameters of the sand a number for each world, in place of one for all.

        They are arrays of Warp then, `sands.xi_n` and the like, (nworld,), to be written in place: `warp.to_torch`
        shares them. A captured graph reads what is in them, so this comes before the capture.

        Args:
            *names: Some of PARAMETERS.

        Raises:
            ValueError: There is no such parameter.
        """
        for name in names:
            if name not in PARAMETERS:
                raise ValueError(f"no parameter {name!r} of the sand; there are {', '.join(PARAMETERS)}")
            values = getattr(self.sands, name).numpy()
            if len(values) == 1:
                setattr(self.sands, name, wp.full(self.nworld, float(values[0]), dtype=float))

    @property
    def _over_bodies(self) -> tuple[int, int]:
        return self.nworld, len(self.bodies)

    def begin(self, m: Any, d: Any) -> None:
        """Find how the bodies move at the start of a step, and what their wheels left behind."""
        wp.launch(
            linear.find_motions,
            dim=(self.nworld, self._paths.dof.size),
            inputs=[self._surfaces, self._paths, m.body_rootid, d.xpos, d.subtree_com, d.cdof, self._model],
        )
        wp.launch(
            guess.begin,
            dim=self._over_bodies,
            inputs=[self._surfaces, self._paths, d.time, d.qvel, d.xmat, self.is_implicit, self._model, self._state],
        )
        if self._has_wheels:
            wp.launch(
                find_drop, dim=self._over_bodies, inputs=[self._surfaces, self.sands, self._state, d.xpos, d.xmat]
            )

    def go_on(self, d: Any, velocity: Any) -> None:
        """Take the twists about which the force is linearised to those at a velocity, (nworld, nv)."""
        wp.launch(
            guess.go_on,
            dim=self._over_bodies,
            inputs=[self._surfaces, self._paths, velocity, d.xmat, self._model, self._state],
        )

    def evaluate(self, m: Any, d: Any) -> None:
        """Evaluate the force, and for the implicit one its derivative."""
        given = [self._surfaces, self.sands, self._state, d.xpos, d.xmat, self._nlane]
        threads = (*self._over_bodies, self._nlane)
        if self.is_implicit:
            wp.launch(self._kernels.implicit, dim=threads, inputs=[*given, m.opt.timestep])
            gather = equation.gather
        else:
            wp.launch(self._kernels.explicit, dim=threads, inputs=given)
            gather = equation.gather_wrenches
        wp.launch(gather, dim=self._over_bodies, inputs=[self._surfaces, self._state, d.xmat, self._nlane, self._model])

    def add_stiffness(self, m: Any, matrix: Any, out: Any) -> None:
        """Fill out with a matrix of the mass matrix's entries and the sand's share, (nworld, nC)."""
        wp.launch(
            equation.add_stiffness,
            dim=matrix.shape,
            inputs=[self._paths, self._state, self._model, m.opt.timestep, matrix, out],
        )

    def add_force(self, force: Any) -> None:
        """Add the generalised force at the velocity of the start of the step, (nworld, nv)."""
        wp.launch(
            equation.add_force,
            dim=force.shape,
            inputs=[self._paths, self._state, self._model, self.is_implicit, force],
        )

    def find_wrenches(self, velocity: Any) -> Any:
        """The wrenches at the end of a step at a velocity, (nworld, nbody) of spatial vectors, force first."""
        wp.launch(
            equation.find_wrenches,
            dim=self._over_bodies,
            inputs=[self._paths, self._state, self._model, velocity, self.is_implicit],
            outputs=[self._wrenches],
        )
        return self._wrenches

    def forget(self, reset: Any) -> None:
        """Forget the past of the worlds that are reset, (nworld,) of bool."""
        wp.launch(linear.forget, dim=self._over_bodies, inputs=[reset, self._state, self._model])


def _counterpart(model: mujoco.MjModel, body: int, onto: mujoco.MjModel) -> int:
    """The id in another model of the body of the same name."""
    name = model.body(body).name
    found = mujoco.mj_name2id(onto, mujoco.mjtObj.mjOBJ_BODY, name)
    if found < 0:
        raise SceneError(
            f"body {name!r} feels the sand, but the model that mujoco_warp was given has none of that name"
        )
    return int(found)


def _kernels_for(packed: Any) -> Kernels:
    """The kernels of the law of packed sand, made once in a process."""
    response = RESPONSES[int(packed.response)]
    terms = {CUBIC: len(TABLE_C3), QUARTIC: len(TABLE_C4)}.get(response, 0)
    table = tuple(tuple(map(float, column[:terms])) for column in packed.table)
    if (response, table) not in _kernels:
        _kernels[response, table] = kernels_of(response, table)
    return _kernels[response, table]


def _put_sands(packed: Any) -> Any:
    """The sand of all worlds, the same in each."""
    sands = Sands()
    for name in PARAMETERS:
        setattr(sands, name, wp.array([float(packed[name])], dtype=float))
    sands.dynamic = float(packed.dynamic)
    sands.up, sands.plane = wp.vec3(*map(float, packed.up)), wp.vec3(*map(float, packed.plane))
    return sands


def _make_state(nworld: int, nbody: int, nlane: int, paths: Any) -> tuple[Any, Any]:
    """What is known of bodies in many worlds, and their linearised wrenches; all zero."""
    state, model = State(), linear.Model()
    shape = nworld, nbody
    state.near = wp.zeros(shape, dtype=int)
    state.rear, state.drop = wp.zeros(shape, dtype=wp.vec4), wp.zeros(shape, dtype=float)
    state.wrench = wp.zeros((*shape, nlane), dtype=wp.spatial_vector)
    state.parts = wp.zeros((*shape, nlane, PARTS), dtype=wp.mat33)
    state.twist = wp.zeros(shape, dtype=wp.spatial_vector)
    model.clock, model.near_before = wp.full(shape, linear.NEVER, dtype=float), wp.zeros(shape, dtype=int)
    for name in ("twist", "wrench", "start", "strain", "start_before", "strain_before"):
        setattr(model, name, wp.zeros(shape, dtype=wp.spatial_vector))
    model.stiffness, model.secant = wp.zeros(shape, dtype=mat66), wp.zeros(shape, dtype=float)
    model.motion = wp.zeros((nworld, max(paths.dof.size, 1)), dtype=wp.spatial_vector)
    return state, model
