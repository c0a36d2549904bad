"""Surfaces reduced to the fewest elements that keep a body's wrench."""
