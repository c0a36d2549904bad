"""What rftsim_mpm raises."""


class MpmError(ValueError):
    """An input that cannot be: what was wrong, and what would have been right."""
