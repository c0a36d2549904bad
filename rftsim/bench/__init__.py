"""Measurements of rftsim itself: stability against the time step, and what it costs."""
