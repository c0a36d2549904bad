"""Sand for MuJoCo: granular resistive forces on the bodies of any model."""

from rftsim.engine import pickles as _pickles
from rftsim.engine import plugin as _plugin
from rftsim.errors import RftsimError, RftsimNote, RftsimWarning, SandError, SceneError, SurfaceError
from rftsim.law.laws import LAWS, Law
from rftsim.law.rigid import Intruder, SurfaceForce, Wrench, surface_force
from rftsim.model.add_sand import Bed, add_sand, load
from rftsim.model.ground import Ground, ground
from rftsim.model.reactions import rne_post_constraint
from rftsim.model.readout import Instance, Tractions, Work, Wrenches, instances, tractions, work, wrenches
from rftsim.sand.dune_field import dunes
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.heights import load_terrain
from rftsim.sand.medium import Sand
from rftsim.sand.presets import PRESETS, make_sand
from rftsim.sand.ruts import Ruts
from rftsim.sand.terrain import Terrain
from rftsim.sand.terrains import make_terrain
from rftsim.surface import shapes
from rftsim.surface.triangles import Surface, Wheel, load_surface, make_surface

_plugin.register(_plugin.EXPLICIT)
_plugin.register(_plugin.IMPLICIT)
_pickles.register()
