"""Sand: its parameters, presets, and the free surface."""

from rftsim.sand.dune_field import dunes
from rftsim.sand.free_surface import FreeSurface
from rftsim.sand.heights import load_terrain
from rftsim.sand.medium import Sand
from rftsim.sand.presets import PRESETS, make_sand
from rftsim.sand.ruts import Ruts
from rftsim.sand.terrain import Terrain
from rftsim.sand.terrains import make_terrain
