"""Sand: the parameters of a granular medium."""

import dataclasses
import math
import warnings
from typing import Any, Final

from rftsim.errors import RftsimWarning, SandError
from rftsim.sand.strength import GRAVITY, xi_n_from_table

ALPHA_Z_PLATE: Final = 0.87574
"""Generic stress of 3D-RFT (Table C.3) on a flat plate pushed straight down; joins zeta and xi_n."""

STEEPEST: Final = math.radians(35.0)
"""Angle of repose of a sand of unknown friction, about the steepest there is [rad]."""


def number(default: float | None, *, above: float | None = None, at_least: float | None = None) -> Any:
    """A field of `Sand` for a parameter that is a number, with its default and its lower bound.

    Args:
        default: Its default; None where it may be unknown.
        above: What it must exceed.
        at_least: What it must not fall below.
    """
    return dataclasses.field(default=default, metadata={"above": above, "at_least": at_least})


@dataclasses.dataclass(frozen=True)
class Sand:
    """A dry granular medium, in SI units.

    Of the two strengths, each 3D law needs `xi_n` and each 2D law `zeta`. What is not given follows from the other
    through a flat plate pushed straight down, zeta = 0.87574 xi_n; where neither is given, xi_n is interpolated in
    [Agarwal] Table C.1 from `rho_c`, `mu_int` and `g`.

    Raises:
        SandError: A parameter is out of range, or too few are given.
    """

    rho_c: float | None = number(None, above=0.0)
    """Bulk density at the critical state [kg/m^3]; None where unknown."""
    mu_int: float | None = number(None, above=0.0)
    """Internal friction [-]; None where unknown."""
    mu_surf: float = number(0.4, at_least=0.0)
    """Friction between the sand and the bodies [-]; above mu_int it is doubtful, and warned about."""
    xi_n: float | None = number(None, above=0.0)
    """Strength in the 3D laws [N/m^3]."""
    zeta: float | None = number(None, above=0.0)
    """Strength in the 2D laws [N/m^3]; 1e6 times its value in N/cm^3."""
    lambda_: float = number(1.0, at_least=0.0)
    """Factor of the inertial term of the dynamic laws [-]: 1.0 wheel, 1.1 horizontal plate drag, 1.4 sphere impact, 2.8
    plane-strain vertical plate, about 4 runner. For 3D-DRFT none has been published; with 1.0 spheres
    stop 0.87 times as deep as was measured (`rftsim validate impact`)."""
    g: float = number(GRAVITY, above=0.0)
    """Gravity that the sand's strength belongs to [m/s^2]."""
    grain_diameter: float | None = number(None, above=0.0)
    """Grain diameter [m], for the inertial number of the validity report; None where unknown."""
    source: str = ""
    """Reference that the numbers come from."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value is None and field.default is not None:
                raise SandError(f"{field.name} must be a number, not None")
            if field.name == "source" and not isinstance(value, str):
                raise SandError(f"source must be text, not {value!r}")
            if field.name != "source" and value is not None:
                object.__setattr__(self, field.name, finite(field.name, value))
        for field in dataclasses.fields(self):
            check_bounds(field, getattr(self, field.name))
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

    @property
    def repose(self) -> float:
        """Angle of repose [rad], whose tangent is the internal friction; of unknown friction, the steepest there is."""
        return STEEPEST if self.mu_int is None else math.atan(self.mu_int)

    def density(self) -> float:
        """The density rho_c [kg/m^3], which the dynamic laws need.

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
            check_known(key)
            if key in ("rho_c", "mu_int", "g") and value is not None:
                changes[key] = finite(key, value)
        if any(key in changes and changes[key] is None for key in ("rho_c", "mu_int")):
            return dataclasses.replace(self, **changes)  # nothing can follow from what is unknown
        if not {"xi_n", "zeta"} & set(changes):
            assert self.xi_n is not None
            assert self.zeta is not None
            factor = finite("g", changes.get("g", self.g)) / self.g
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


DEFAULTS: Final = {field.name: field.default for field in dataclasses.fields(Sand)}
"""The default of each parameter by its name, `source` included."""
PARAMETERS: Final = tuple(name for name in DEFAULTS if name != "source")
"""Names of the parameters that are numbers."""


def check_known(name: str) -> None:
    """Refuse a name that is no parameter of a sand.

    Raises:
        SandError: There is no such parameter; the message lists those there are.
    """
    if name not in DEFAULTS:
        raise SandError(f"sand has no parameter {name!r}; it has {', '.join(sorted(DEFAULTS))}")


def finite(name: str, value: object) -> float:
    """The value of a parameter as a finite number, from a number or its text.

    Raises:
        SandError: It is no number, or not finite.
    """
    try:
        if isinstance(value, bool):
            raise TypeError
        found = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise SandError(f"{name} must be a number, not {value!r}") from None
    except OverflowError:
        raise SandError(f"{name} must be finite, not a whole number of so many digits") from None
    if not math.isfinite(found):
        raise SandError(f"{name} must be finite, not {found}")
    return found


def check_parameter(name: str, value: object) -> None:
    """Refuse a value of a parameter that no sand has; None is unknown, and may be.

    Raises:
        SandError: It is no finite number, or outside the parameter's bounds.
    """
    if value is not None:
        (field,) = (field for field in dataclasses.fields(Sand) if field.name == name)
        check_bounds(field, finite(name, value))


def check_bounds(field: "dataclasses.Field[Any]", value: float | None) -> None:
    """Refuse a value that the bounds of its field exclude; None is unknown, and within any.

    Raises:
        SandError: The value is too small.
    """
    above, at_least = field.metadata.get("above"), field.metadata.get("at_least")
    if value is None:
        return
    if above is not None and not value > above:
        raise SandError(f"{field.name} must be {f'above {above:g}' if above else 'positive'}, not {value:g}")
    if at_least is not None and not value >= at_least:
        raise SandError(f"{field.name} must be {f'{at_least:g}' if at_least else 'zero'} or more, not {value:g}")
