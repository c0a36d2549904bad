"""Sand for MuJoCo: granular resistive forces on the bodies of any model."""

from rftsim.engine import plugin as _plugin
from rftsim.errors import RftsimError, RftsimWarning, SandError, SceneError, SurfaceError
from rftsim.laws import LAWS, Law
from rftsim.readout import Instance, Tractions, Work, Wrenches, instances, tractions, work, wrenches
from rftsim.rigid import SurfaceForce, surface_force
from rftsim.sand import PRESETS, FreeSurface, Sand, make_sand
from rftsim.scene import Bed, add_sand, load
from rftsim.surface import Surface, Wheel, load_surface, make_surface

_plugin.register(_plugin.EXPLICIT)
_plugin.register(_plugin.IMPLICIT)
