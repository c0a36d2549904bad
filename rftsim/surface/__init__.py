"""Surfaces of bodies: triangles that the sand can press on."""

from rftsim.surface.triangles import Array, Surface, Wheel, load_surface, make_surface
