"""The power that actuators give in each world."""

import warp as wp


@wp.kernel(enable_backward=False)
def add_power(force: wp.array2d(dtype=float), rate: wp.array2d(dtype=float), energy: wp.array(dtype=float)):
    """Add the actuators' positive power in each world, from their forces and rates, (nworld, nu) each [W]."""
    world = wp.tid()
    power = float(0.0)
    for k in range(force.shape[1]):
        power += wp.max(force[world, k] * rate[world, k], 0.0)
    energy[world] += power
