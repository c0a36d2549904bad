"""Force laws: the stress of sand on a triangle, and what it amounts to on a body."""
