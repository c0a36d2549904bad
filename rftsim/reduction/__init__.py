"""The fewest elements that keep a body's wrench."""
