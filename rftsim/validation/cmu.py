"""Reading the measurements of Pavlov and Johnson, CMU "3d-terramechanics" (MIT licence): a wheel, and plates."""

import hashlib
import math
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from rftsim.errors import RftsimError
from rftsim.fit.columns import read_columns, read_table
from rftsim.surface.triangles import Array

WHEEL_FILE: Final = "cmu_wheel_grouser.csv"
PLATE_FILE: Final = "cmu_circular_plate_sinkage.csv"
SMOOTH_FILE: Final = "cmu_wheel_smooth.csv"
"""A smooth wheel in the same sand, of the same columns; not among the data that come with the grousered one."""

FILES: Final = (WHEEL_FILE, PLATE_FILE, SMOOTH_FILE)
"""The files of measurements that are looked for."""


class Runs(NamedTuple):
    """Measured runs of a wheel, a value for each; shape (n,) unless said."""

    slip: Array
    """Slip ratio [-]."""
    angle: Array
    """Slip angle [rad]."""
    travel: Array
    """Speed of the axle [m/s]."""
    rim: Array
    """Speed of the rim [m/s]."""
    sinkage: Array
    """Sinkage of the grousers' tips [m]."""
    force: Array
    """Drawbar, side force and load [N], shape (n, 3)."""

    def velocity(self, run: int) -> tuple[float, float]:
        """Velocity of the axle along and across the wheel's heading in a run [m/s]."""
        travel, angle = float(self.travel[run]), float(self.angle[run])
        return travel * math.cos(angle), travel * math.sin(angle)


class PlateTest(NamedTuple):
    """A test in which a circular plate is pushed into the sand."""

    diameter: float
    """Diameter of the plate [m]."""
    depth: Array
    """Depths at which the force was read [m], shape (n,)."""
    force: Array
    """Vertical force on the plate [N], shape (n,)."""

    @property
    def area(self) -> float:
        """Area of the plate on the sand [m^2]."""
        return math.pi / 4 * self.diameter**2


def read_runs(path: Path) -> Runs:
    """Read the runs of a wheel from its file.

    Raises:
        RftsimError: The file lacks a column, or a number.
    """
    names = ("slip_ratio", "slip_angle_deg", "travel_speed_mm_s", "rim_speed_mm_s", "sinkage_mm")
    columns = read_columns(path, (*names, "F_drawbar_N", "F_sidewall_N", "F_load_N"))
    slip, angle, travel, rim, sinkage, *force = columns.values()
    return Runs(slip, np.radians(angle), travel / 1e3, rim / 1e3, sinkage / 1e3, np.column_stack(force))


def read_plates(path: Path) -> list[PlateTest]:
    """Read the tests of circular plates from their file.

    Raises:
        RftsimError: The file lacks a column, a number, or a second size of plate.
    """
    numbers, words = read_table(path, ("plate_diameter_mm", "depth_m", "force_N"), words=("box", "trial"))
    labels = list(zip(words["box"], words["trial"], numbers["plate_diameter_mm"], strict=True))
    depth, force = numbers["depth_m"], numbers["force_N"]
    tests = []
    for label in dict.fromkeys(labels):
        own = np.array([other == label for other in labels])
        tests.append(PlateTest(float(label[2]) / 1e3, depth[own], force[own]))
    if len({test.diameter for test in tests}) < 2:
        raise RftsimError(f"{path} has plates of one size; k_c and k_phi take two or more")
    return tests


def digest(path: Path) -> str:
    """The first 12 hexadecimal digits of the SHA-256 of a file's content."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:12]
