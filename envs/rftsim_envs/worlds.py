"""Simulations of one model side by side in mujoco_warp, on a GPU; of the extra `rftsim[warp]`."""

import copy
from collections.abc import Callable, Sequence
from typing import Any, Final

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp

from rftsim.model.readout import Instance, instances
from rftsim.warp.bed import PARAMETERS, WarpBed
from rftsim.warp.power import add_power
from rftsim.warp.sand import put, without_plugin
from rftsim_envs.physics import Array, Flags, home_of

CONTACTS: Final = 64
"""Contacts that a simulation may have at once, in the mean."""
ROWS: Final = 256
"""Rows of constraints that a simulation may have at once."""
LARGEST: Final = 1e10
"""Size of a position or velocity beyond which a simulation is given up, as MuJoCo does."""
_WRITTEN: Final = ("qpos", "qvel", "ctrl")
"""Fields that episodes write to."""
_FAILING: Final = ("qpos", "qvel")
"""Fields by which a simulation is found to have failed."""


class Worlds:
    """Many simulations as worlds of mujoco_warp: a `Physics` in single precision.

    Arrays are copies in this machine's memory, which are sent and fetched once in a control step.

    Args:
        model: Model that all simulate; it is not changed.
        n: Number of simulations.

    Raises:
        SceneError: The model has sand that Warp does not know: terrain, or ruts.
    """

    def __init__(self, model: mujoco.MjModel, n: int) -> None:
        self.model, self.shown, self.n = model, copy.copy(model), n
        self._beds = instances(model)
        sizes, self._sand = {"nworld": n, "nconmax": CONTACTS, "njmax": ROWS}, None
        if self._beds:
            self._m, self._d, self._sand, plain = put(model, **sizes)
            for bed in self._sand.beds:
                bed.vary(*PARAMETERS)
        else:
            plain = without_plugin(model)
            self._m, self._d = mjw.put_model(plain), mjw.put_data(plain, mujoco.MjData(plain), **sizes)
        self._initial, self._data = mujoco.MjData(plain), mujoco.MjData(self.shown)
        mujoco.mj_forward(plain, self._initial)
        self._fields: dict[str, Array] = {}
        self._settings: dict[str, Array] = {}
        self._graphs: dict[int, Any] = {}
        for name in _WRITTEN:
            self.field(name)
        self._energy, self._failed = wp.zeros(n, dtype=float), np.zeros(n, dtype=bool)

    def field(self, name: str) -> Array:
        """A field of MjData, (n, ...), fetched after each control step and restart."""
        if name not in self._fields:
            shape = np.shape(getattr(self._initial, name))
            self._fields[name] = getattr(self._d, name).numpy().reshape(self.n, *shape).astype(float)
        return self._fields[name]

    def setting(self, name: str) -> Array:
        """A field of MjModel or an option, (n, ...), whose changes count from a simulation's restart.

        Of `numeric_data` those of the sand's parameters count.
        """
        if name not in self._settings:
            value = np.asarray(getattr(*home_of(self.model, name)), dtype=float)
            self._settings[name] = np.tile(value, (self.n,) + (1,) * value.ndim)
            if name != "numeric_data":  # mujoco_warp takes as many rows as there are, over and over
                home, option = home_of(self._m, name)
                own = getattr(home, option)
                setattr(home, option, wp.array(self._settings[name], dtype=own.dtype, device=own.device))
                self._graphs.clear()
        return self._settings[name]

    def step(self, nstep: int) -> Array:
        """Take time steps in all simulations, and return the actuators' mean positive power [W], (n,)."""
        self._send("ctrl")
        self._energy.zero_()
        wp.capture_launch(self._graph(nstep))
        self._fetch(np.ones(self.n, dtype=bool))
        power: Array = np.nan_to_num(self._energy.numpy().astype(float)) / nstep
        return power

    def restart(self, chosen: Sequence[int], place: Callable[[], None]) -> None:
        """Take the chosen simulations to the model's initial state, let `place` write to it, and compute the rest."""
        mask = np.zeros(self.n, dtype=bool)
        mask[list(chosen)] = True
        which = wp.array(mask, dtype=bool)
        mjw.reset_data(self._m, self._d, which)
        if self._sand is not None:
            self._sand.reset(which)
        self._failed[mask] = False
        for name in _WRITTEN:
            self._fields[name][mask] = getattr(self._initial, name)
        place()
        self._send(*_WRITTEN)
        self._send_settings()
        before = self._d.qfrc_constraint.numpy()  # what the others' next step begins with
        before[mask] = 0.0
        mjw.forward(self._m, self._d)
        self._d.qfrc_constraint.assign(before)
        self._fetch(mask)

    def failed(self) -> Flags:
        """Whether a simulation's state is not finite, or too large, since its restart, (n,)."""
        return self._failed.copy()

    def snapshot(self, i: int) -> mujoco.MjData:
        """Data of simulation i as MuJoCo's mj_forward has them, the engine plugin's sand included."""
        for name, values in self._settings.items():
            getattr(*home_of(self.shown, name))[:] = values[i]
        for name in _WRITTEN:
            getattr(self._data, name)[:] = self._fields[name][i]
        self._data.time = float(self._d.time.numpy()[i])
        mujoco.mj_forward(self.shown, self._data)
        return self._data

    def _graph(self, nstep: int) -> Any:
        """Time steps as a graph of the device, made at the first call."""
        if nstep not in self._graphs:
            given = [self._d.actuator_force, self._d.actuator_velocity]
            with wp.ScopedCapture() as capture:
                for _ in range(nstep):
                    mjw.step(self._m, self._d)
                    wp.launch(add_power, dim=self.n, inputs=given, outputs=[self._energy])
            self._graphs[nstep] = capture.graph
        return self._graphs[nstep]

    def _send(self, *names: str) -> None:
        for name in names:
            getattr(self._d, name).assign(self._fields[name].astype(np.float32))

    def _send_settings(self) -> None:
        """Send what may have been written into the settings."""
        for name, values in self._settings.items():
            if name == "numeric_data":
                for bed, own in zip(self._beds, self._sand.beds if self._sand else [], strict=True):
                    _send_bed(bed, own, values)
            else:
                getattr(*home_of(self._m, name)).assign(values.astype(np.float32))

    def _fetch(self, chosen: Flags) -> None:
        """Fetch the fields of the chosen simulations; of one that failed, since then, those of the initial state."""
        for name, kept in self._fields.items():
            kept[chosen] = getattr(self._d, name).numpy().reshape(kept.shape)[chosen]
        for name in _FAILING:
            kept = self._fields[name].reshape(self.n, -1)
            self._failed |= ~(np.isfinite(kept) & (np.abs(kept) < LARGEST)).all(axis=1)
        if self._failed.any():
            for name, kept in self._fields.items():
                kept[self._failed] = getattr(self._initial, name)


def _send_bed(bed: Instance, own: WarpBed, numbers: Array) -> None:
    """Send the parameters of a bed's sand, of which each simulation has its own in `numeric_data`."""
    beds = bed.beds_in(numbers)
    for name in PARAMETERS:
        getattr(own.sands, name).assign(beds[name].astype(np.float32))
