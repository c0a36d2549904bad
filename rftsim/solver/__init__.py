"""The implicit force: the equation of a time step, its solution, and the step that is split where it is too long."""
