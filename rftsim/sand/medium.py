"""Sand: the parameters of a granular medium."""

import dataclasses
import math
import warnings
from typing import Any, Final

from rftsim.errors import RftsimWarning, SandError
from rftsim.sand.strength import GRAVITY, xi_n_from_table

ALPHA_Z_PLATE: Final = 0.87574
"""Generic stress of 3D-RFT (Table C.3) on a flat plate pushed straight down; joins zeta and xi_n."""


@dataclasses.dataclass(frozen=True)
class Sand:
    """A dry granular medium, in SI units.

    Of the two strengths, each 3D law needs `xi_n` and each 2D law `zeta`. What is not given follows from the other
    through a flat plate pushed straight down, zeta = 0.87574 xi_n; where neither is given, xi_n is interpolated in
    [Agarwal] Table C.1 from `rho_c`, `mu_int` and `g`.

    Attributes:
        rho_c: Bulk density at the critical state [kg/m^3]; None where unknown.
        mu_int: Internal friction [-]; None where unknown.
        mu_surf: Friction between the sand and the bodies [-]; above mu_int it is doubtful, and warned about.
        xi_n: Strength in the 3D laws [N/m^3].
        zeta: Strength in the 2D laws [N/m^3]; 1e6 times its value in N/cm^3.
        lambda_: Factor of the inertial term of the dynamic laws [-]: 1.0 wheel, 1.1 horizontal plate drag, 1.4 sphere
            impact, 2.8 plane-strain vertical plate, about 4 runner. For 3D-DRFT no calibration has been published.
        g: Gravity that the sand's strength belongs to [m/s^2].
        grain_diameter: Grain diameter [m], for the inertial number of the validity report; None where unknown.
        source: Where the numbers come from.

    Raises:
        SandError: A parameter is out of range, or too few are given.
    """

    rho_c: float | None = None
    mu_int: float | None = None
    mu_surf: float = 0.4
    xi_n: float | None = None
    zeta: float | None = None
    lambda_: float = 1.0
    g: float = GRAVITY
    grain_diameter: float | None = None
    source: str = ""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value is None and field.default is not None:
                raise SandError(f"{field.name} must be a number, not None")
            if field.name != "source" and value is not None:
                object.__setattr__(self, field.name, _finite(field.name, value))
        for name, low in _ABOVE_ZERO.items():
            value = getattr(self, name)
            if value is not None and not (value > 0.0 if low else value >= 0.0):
                raise SandError(f"{name} must be {'positive' if low else 'zero or more'}, not {value:g}")
        if self.mu_int is not None and self.mu_surf > self.mu_int:
            warnings.warn(
                f"mu_surf = {self.mu_surf:g} exceeds mu_int = {self.mu_int:g}: sand slips inside itself first, "
                f"so mu_surf <= {self.mu_int:g} is the largest that means anything",
                RftsimWarning,
                stacklevel=3,
            )
        if self.xi_n is None:
            object.__setattr__(self, "xi_n", self._strength())
        if self.zeta is None:
            assert self.xi_n is not None
            object.__setattr__(self, "zeta", ALPHA_Z_PLATE * self.xi_n)

    def _strength(self) -> float:
        if self.zeta is not None:
            return self.zeta / ALPHA_Z_PLATE
        if self.rho_c is None or self.mu_int is None:
            raise SandError("sand needs a strength: give xi_n, or zeta, or rho_c and mu_int")
        return xi_n_from_table(self.rho_c, self.mu_int, self.g)

    def density(self) -> float:
        """rho_c, which the dynamic laws need.

        Raises:
            SandError: The density is unknown.
        """
        if self.rho_c is None:
            raise SandError("the dynamic laws need the sand's density: give rho_c [kg/m^3]")
        return self.rho_c

    def replace(self, **changes: Any) -> "Sand":
        """A copy with some parameters changed.

        Strengths that follow from what is changed follow again, unless they are among the changes: a new `xi_n` gives
        a new `zeta` and the other way round; a new `rho_c` scales both, as does a new `g`; a new `mu_int` takes xi_n
        from Table C.1 and keeps zeta / xi_n.
        """
        for key, value in changes.items():
            if key not in _DEFAULTS:
                raise SandError(f"sand has no parameter {key!r}; it has {', '.join(sorted(_DEFAULTS))}")
            if key in ("rho_c", "mu_int", "g") and value is not None:
                changes[key] = _finite(key, value)
        if any(key in changes and changes[key] is None for key in ("rho_c", "mu_int")):
            return dataclasses.replace(self, **changes)  # nothing can follow from what is unknown
        if not {"xi_n", "zeta"} & set(changes):
            assert self.xi_n is not None
            assert self.zeta is not None
            factor = _finite("g", changes.get("g", self.g)) / self.g
            if self.rho_c is not None:
                factor *= changes.get("rho_c", self.rho_c) / self.rho_c
            if changes.get("mu_int", self.mu_int) != self.mu_int and self.mu_int is not None:
                factor *= xi_n_from_table(1.0, changes["mu_int"]) / xi_n_from_table(1.0, self.mu_int)
            changes = {"xi_n": factor * self.xi_n, "zeta": factor * self.zeta, **changes}
        elif "xi_n" not in changes or "zeta" not in changes:
            changes = {"xi_n": None, "zeta": None, **changes}
        return dataclasses.replace(self, **changes)

    @classmethod
    def from_vertical_plate(cls, force: float, area: float, depth: float, **parameters: Any) -> "Sand":
        """Sand whose strength comes from a plate test, [Agarwal] eq. (5.21).

        Args:
            force: Force on the plate pushed straight down [N].
            area: Its area [m^2].
            depth: Its depth [m].
            **parameters: The other parameters of `Sand`.
        """
        for name, value in {"force": force, "area": area, "depth": depth}.items():
            if not value > 0.0:
                raise SandError(f"the plate test's {name} must be positive, not {value:g}")
        return cls(xi_n=force / (ALPHA_Z_PLATE * area * depth), **parameters)


_ABOVE_ZERO: Final = {
    "rho_c": True,
    "mu_int": True,
    "mu_surf": False,
    "xi_n": True,
    "zeta": True,
    "lambda_": False,
    "g": True,
    "grain_diameter": True,
}


_DEFAULTS: Final = {field.name: field.default for field in dataclasses.fields(Sand)}


def _finite(name: str, value: object) -> float:
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise SandError(f"{name} must be a number, not {value!r}") from None
    if not math.isfinite(number):
        raise SandError(f"{name} must be finite, not {number}")
    return number
