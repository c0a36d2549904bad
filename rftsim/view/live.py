"""A model on sand, live in MuJoCo's viewer: real time, pushed with the mouse, sand that grows stronger or weaker."""

import contextlib
import math
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any, Final, Protocol

import mujoco
import numpy as np

from rftsim.errors import RftsimError
from rftsim.model.readout import instances
from rftsim.model.standing import moving_weight
from rftsim.run.robot import against_gravity, total_force
from rftsim.view.cameras import framing
from rftsim.view.drawing import Drawing, Shown
from rftsim.view.fields import Fields
from rftsim.view.look import dress, sand_geoms
from rftsim.view.tractions import said

FRAME: Final = 1.0 / 60.0
"""Time between two pictures [s]."""
LONGEST: Final = 0.05
"""Simulated time that a picture waits for, at most; a slower simulation falls behind real time [s]."""
FACTOR: Final = 1.25
"""Factor by which a key makes the sand stronger or weaker."""
GROUND: Final = 0.1
"""Time between two looks at the ground, which may have got marks or been left behind [s]."""
OPACITIES: Final = (1.0, 0.5, 0.2)
"""Opacities of the sand, which a key goes through."""
SPACE, BACKSPACE, DOWN, UP = 32, 259, 264, 265
"""Codes of the viewer's keys."""
KEYS: Final = (
    ("Space", "pause"),
    ("Backspace", "start again"),
    ("Up, Down", "sand stronger, weaker"),
    ("6", "forces"),
    ("7", "tractions"),
    ("8", "see through the sand"),
    ("T", "see through the model"),
    ("double click, Ctrl + drag", "choose a body, push it"),
)
"""The keys, and what each does."""


class Handle(Protocol):
    """The part of MuJoCo's passive viewer that the live view needs."""

    user_scn: mujoco.MjvScene
    perturb: mujoco.MjvPerturb

    def is_running(self) -> bool:
        """Tell whether the window is still open."""
        ...

    def lock(self) -> contextlib.AbstractContextManager[Any]:
        """A context in which the viewer leaves the model and its data alone."""
        ...

    def update_hfield(self, hfieldid: int) -> None:
        """Take over the heights of a height field, to be drawn."""
        ...

    def sync(self) -> None:
        """Take over the data as they are, to be drawn."""
        ...

    def set_texts(self, texts: Any) -> None:
        """Lay texts over the picture, each with a font, a place, and two columns."""
        ...


class Live:
    """A simulation that follows a clock, and what keys do to it.

    Those that inherit step and begin in their own way, as a policy's episodes do.

    Args:
        model: Compiled, with sand; its sand is what the keys change, and how that is drawn.
        begin: Makes the data of the start.

    Attributes:
        tick: Simulated time of a `step` [s].
    """

    def __init__(self, model: mujoco.MjModel, begin: Callable[[], mujoco.MjData]) -> None:
        self.model, self.start = model, begin()
        self.data, self.tick = begin(), float(model.opt.timestep)
        self.shown = Shown()
        self.paused = False
        self.strength = 1.0
        self._drawing, self._opacity, self._owed = Drawing(model), 0, 0.0
        dress(model, self._drawing.extent)
        self._cover()
        self._ground, self._looked = Fields(model), -math.inf
        self.look(0.0)
        self._pressed: list[int] = []

    def press(self, key: int) -> None:
        """Note a key by its code; it does its work before the next step, as the viewer calls from its own thread."""
        self._pressed.append(key)

    def advance(self, span: float, perturb: mujoco.MjvPerturb) -> None:
        """Obey the keys, and simulate a span of time [s] under the push of the mouse."""
        while self._pressed:
            self._obey(self._pressed.pop(0))
        self.data.xfrc_applied[:] = 0.0
        mujoco.mjv_applyPerturbPose(self.model, self.data, perturb, int(self.paused))
        mujoco.mjv_applyPerturbForce(self.model, self.data, perturb)
        if self.paused:
            mujoco.mj_forward(self.model, self.data)
            return
        self._owed = min(self._owed + span, max(LONGEST, self.tick))
        steps = int(self._owed / self.tick)
        self._owed -= steps * self.tick
        for _ in range(steps):
            self.step()

    def step(self) -> None:
        """Let the simulation go on by a tick."""
        mujoco.mj_step(self.model, self.data)

    def restart(self) -> None:
        """Go back to the start, in the same data, which the viewer holds."""
        kept = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(self.model, kept))
        mujoco.mj_getState(self.model, self.start, state, kept)
        mujoco.mj_setState(self.model, self.data, state, kept)
        mujoco.mj_forward(self.model, self.data)

    def aim(self) -> mujoco.MjvCamera:
        """A camera that shows everything that can move, as the window's begins."""
        return framing(self.model, self.data)

    def draw(self, scene: mujoco.MjvScene) -> None:
        """Fill the viewer's own scene with what the sand does."""
        scene.ngeom = 0
        self._drawing.draw(scene, self.data, self.shown)

    def look(self, now: float) -> list[int]:
        """Take over the ground as it is, if some time has passed; ids of the height fields that changed.

        Args:
            now: Time by any clock [s].
        """
        if now - self._looked < GROUND:
            return []
        self._looked = now
        return self._ground.follow(self.data)

    def texts(self) -> tuple[str, str]:
        """Two columns of text: the time, the sand, and the keys."""
        names, values = zip(*self.state(), *KEYS, strict=True)
        return "\n".join(names), "\n".join(values)

    def state(self) -> list[tuple[str, str]]:
        """Names and values of the time, and of what the sand does."""
        weight = moving_weight(self.model)
        lift = against_gravity(self.model, total_force(self.model, self.data))
        carried = f"{100.0 * lift / weight:.0f} % of {weight:.4g} N" if weight > 0.0 else f"{lift:.4g} N"
        state = [
            ("time", f"{self.data.time:.2f} s{', paused' if self.paused else ''}"),
            ("sand carries", carried),
            ("sand's strength", f"{self.strength:.2f}"),
        ]
        if self.shown.tractions:
            state.append(("traction, 0 to", said(self._drawing.largest)))
        return state

    def _obey(self, key: int) -> None:
        shown = self.shown
        if key == SPACE:
            self.paused = not self.paused
        elif key == BACKSPACE:
            self.restart()
        elif key in (UP, DOWN):
            factor = FACTOR if key == UP else 1.0 / FACTOR
            self.strength *= factor
            self.strengthen(factor)
        elif key == ord("6"):
            self.shown = shown._replace(forces=not shown.forces)
        elif key == ord("7"):
            self.shown = shown._replace(tractions=not shown.tractions)
        elif key == ord("8"):
            self._opacity = (self._opacity + 1) % len(OPACITIES)
            self._cover()

    def _cover(self) -> None:
        """Give the drawn sand its opacity."""
        self.model.geom_rgba[list(sand_geoms(self.model)), 3] = OPACITIES[self._opacity]

    def strengthen(self, factor: float) -> None:
        """Multiply the strength of all sand by a factor."""
        for one in instances(self.model):
            one.bed.xi_n *= factor
            one.bed.zeta *= factor


def watch(live: Live, seconds: float | None = None) -> None:
    """Show a simulation live, until its window is closed.

    Args:
        live: The simulation.
        seconds: Time after which it closes by itself [s].

    Raises:
        RftsimError: There is no display to show it on.
    """
    with _window(live) as handle:
        follow(live, handle, seconds)


def follow(live: Live, handle: Handle, seconds: float | None = None) -> None:
    """Let a simulation follow the clock in a viewer, until that is closed or some seconds are over."""
    started = last = time.perf_counter()
    while handle.is_running() and (seconds is None or last - started < seconds):
        now = time.perf_counter()
        with handle.lock():
            live.advance(now - last, handle.perturb)
            live.draw(handle.user_scn)
            changed = live.look(now)
        for one in changed:
            handle.update_hfield(one)
        last = now
        place = mujoco.mjtGridPos.mjGRID_TOPLEFT
        handle.set_texts((mujoco.mjtFontScale.mjFONTSCALE_100, place, *live.texts()))
        handle.sync()
        time.sleep(max(FRAME - (time.perf_counter() - now), 0.0))


@contextlib.contextmanager
def _window(live: Live) -> Iterator[Handle]:
    """A window of MuJoCo's passive viewer, which has let go of the display when the context ends."""
    _check_display()
    import mujoco.viewer

    before = set(threading.enumerate())
    try:
        handle = mujoco.viewer.launch_passive(
            live.model, live.data, key_callback=live.press, show_left_ui=False, show_right_ui=False
        )
    except RuntimeError as error:
        raise RftsimError(f"the viewer does not open: {error}") from error
    try:
        with handle.lock():
            camera = live.aim()
            handle.cam.type, handle.cam.trackbodyid = camera.type, camera.trackbodyid
            handle.cam.lookat[:], handle.cam.distance = camera.lookat, camera.distance
            handle.cam.azimuth, handle.cam.elevation = camera.azimuth, camera.elevation
        yield handle
    finally:
        handle.close()
        for thread in set(threading.enumerate()) - before:  # it draws still, and must not when the display is closed
            thread.join(5.0)


def _check_display() -> None:
    """Refuse where no window can be opened: MuJoCo's viewer would wait for one for ever.

    Raises:
        RftsimError: There is no display, or no OpenGL on it.
    """
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the error says it better
        if not glfw.init():
            raise RftsimError("no display to show the model on; `rftsim run --picture` or `--record` needs none")
        glfw.window_hint(glfw.VISIBLE, False)
        window = glfw.create_window(64, 64, "rftsim", None, None)
        glfw.terminate()
        if not window:
            raise RftsimError("the display has no OpenGL to draw with; `rftsim run --picture` or `--record` needs none")
