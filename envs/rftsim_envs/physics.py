"""Simulations of one model side by side: one on MuJoCo's own data, or many on `mujoco.batch`.

Both hand out the same arrays, whose first axis counts the simulations, and step bit-identically.
"""

import copy
from collections.abc import Callable, Sequence
from typing import Any, Final, Protocol

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_FATAL: Final = [
    int(kind)
    for kind in (
        mujoco.mjtWarning.mjWARN_BADQPOS,
        mujoco.mjtWarning.mjWARN_BADQVEL,
        mujoco.mjtWarning.mjWARN_BADQACC,
        mujoco.mjtWarning.mjWARN_BADCTRL,
    )
]
"""Warnings after which MuJoCo has reset the state, time included, or dropped the controls."""


class Physics(Protocol):
    """Several simulations of one model side by side, as episodes need them."""

    model: mujoco.MjModel
    """Model of all simulations; the sand of each is in `setting("numeric_data")`."""
    n: int
    """Number of simulations."""
    shown: mujoco.MjModel
    """Model that the data of `snapshot` belong to."""

    def field(self, name: str) -> Array:
        """A field of MjData, live, (n, ...); values that are not state are those of the last time step's start."""
        ...

    def setting(self, name: str) -> Array:
        """A field of MjModel, or an option as `opt.gravity`; live and writable, (n, ...)."""
        ...

    def step(self, nstep: int) -> Array:
        """Take some time steps, fewer where one fails, and return the actuators' mean positive power [W], (n,)."""
        ...

    def restart(self, chosen: Sequence[int], place: Callable[[], None]) -> None:
        """Take the chosen simulations to the model's initial state, let `place` write to it, and compute the rest."""
        ...

    def failed(self) -> Flags:
        """Whether MuJoCo has given a simulation up since its restart, (n,)."""
        ...

    def snapshot(self, i: int) -> mujoco.MjData:
        """Data of simulation i to look at; `shown` becomes its model."""
        ...


class One:
    """One simulation, on data of its own or of another.

    Args:
        model: Model that is simulated; it is not copied.
        advance: Takes a time step, as `mujoco.mj_step` does.
        data: The model's data; by default its own.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        advance: Callable[[mujoco.MjModel, mujoco.MjData], None] = mujoco.mj_step,
        data: mujoco.MjData | None = None,
    ) -> None:
        self.model = self.shown = model
        self.data, self.n = mujoco.MjData(model) if data is None else data, 1
        self._advance = advance

    def field(self, name: str) -> Array:
        """A field of MjData as a view with a first axis of one simulation, (1, ...)."""
        view: Array = getattr(self.data, name)[None]
        return view

    def setting(self, name: str) -> Array:
        """A field of MjModel or an option as a view that writes to the model, (1, ...)."""
        view: Array = getattr(*home_of(self.model, name))[None]
        return view

    def step(self, nstep: int) -> Array:
        """Take time steps until one fails, and return the actuators' mean positive power [W], (1,)."""
        force, rate = np.empty((2, 1, nstep, self.model.nu))
        failed = False
        for k in range(nstep):
            if not failed:
                self._advance(self.model, self.data)
                failed = bool(self.failed()[0])
            force[0, k], rate[0, k] = self.data.actuator_force, self.data.actuator_velocity
        return _mean_power(force, rate)

    def restart(self, chosen: Sequence[int], place: Callable[[], None]) -> None:
        """Reset the data, let `place` write to them, and compute the rest."""
        mujoco.mj_resetData(self.model, self.data)
        place()
        mujoco.mj_forward(self.model, self.data)

    def failed(self) -> Flags:
        """Whether a warning of MuJoCo says that it has given the simulation up, (1,)."""
        return np.array([any(self.data.warning[kind].number for kind in _FATAL)])

    def snapshot(self, i: int) -> mujoco.MjData:
        """The data themselves, those of the only simulation."""
        return self.data


class Many:
    """Many simulations on threads, by `mujoco.batch`.

    Args:
        model: Model that all simulate; it is copied.
        n: Number of simulations.
        threads: Number of threads; 0 for as many as there are processors.
    """

    def __init__(self, model: mujoco.MjModel, n: int, threads: int = 0) -> None:
        self.model, self.shown, self.n = model, copy.copy(model), n
        self._batch, self._data = Batch(model, n, threads), mujoco.MjData(self.shown)

    def field(self, name: str) -> Array:
        """A field of MjData as the batch holds it, (n, ...)."""
        view: Array = self._batch.bind(name)
        return view

    def setting(self, name: str) -> Array:
        """A field of MjModel or an option, of which each simulation has its own, (n, ...)."""
        view: Array = self._batch.expand(name)
        return view

    def step(self, nstep: int) -> Array:
        """Take all time steps in one go, and return the actuators' mean positive power [W], (n,)."""
        told = self._batch.rollout(nstep, record=("actuator_force", "actuator_velocity"))  # no thread waits in between
        return _mean_power(told["actuator_force"], told["actuator_velocity"])

    def restart(self, chosen: Sequence[int], place: Callable[[], None]) -> None:
        """Reset the chosen simulations, let `place` write to them, and compute the rest."""
        self._batch.reset(chosen, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        place()
        self._batch.forward(chosen)

    def failed(self) -> Flags:
        """Whether a warning of MuJoCo says that it has given a simulation up, (n,)."""
        counts: NDArray[np.int32] = self._batch.warning[:, _FATAL, 1]
        return np.asarray(counts.any(axis=1))

    def snapshot(self, i: int) -> mujoco.MjData:
        """Copy of the data of simulation i, in which values that are not state are those of an mj_forward."""
        self._batch.get_model(i, self.shown)
        self._batch.get_data(i, self._data)
        mujoco.mj_forward(self.shown, self._data)
        return self._data


def home_of(model: Any, name: str) -> tuple[Any, str]:
    """Where a field of a model, or an option as `opt.gravity`, lies, and its name there."""
    option = name.removeprefix("opt.")
    return (model, name) if option == name else (model.opt, option)


def _mean_power(force: Array, rate: Array) -> Array:
    """Mean positive power over the steps [W], (n,), from forces and rates (n, nstep, nu)."""
    power: Array = np.maximum(force * rate, 0.0).sum(axis=2).mean(axis=1)
    return power
