"""What rftsim_mpm raises."""


class MpmError(Exception):
    """An input that cannot be: what was wrong, and what would have been right.

    Not a ValueError, which the command line would wrap in words of its own.
    """
