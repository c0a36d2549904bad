"""Sand: the parameters of a granular medium, its presets, and the free surface."""

import dataclasses
import math
import tomllib
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from rftsim import tables
from rftsim.errors import RftsimWarning, SandError

ALPHA_Z_PLATE: Final = 0.87574
"""Generic stress of 3D-RFT (Table C.3) on a flat plate pushed straight down; joins zeta and xi_n."""

GRAVITY: Final = 9.81


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


def xi_n_from_table(rho_c: float, mu_int: float, g: float = GRAVITY) -> float:
    """xi_n [N/m^3] by interpolation in [Agarwal] Table C.1.

    Raises:
        SandError: mu_int is outside the table.
    """
    mu, xi = np.array(tables.TABLE_C1).T
    if not mu[0] < mu_int <= mu[-1]:
        raise SandError(f"mu_int = {mu_int:g} is outside Table C.1 (0 to {mu[-1]:g}): give xi_n itself")
    return float(np.interp(mu_int, mu, xi)) * rho_c / tables.TABLE_C1_RHO_C * g / GRAVITY


def xi_n_cubic(rho_c: float, mu_int: float, g: float = GRAVITY) -> float:
    """xi_n [N/m^3] by the cubic of [Agarwal] Fig. C-2, which misses Table C.1 by up to 34 %."""
    a, b, c = tables.XI_N_CUBIC
    return rho_c * g * mu_int * (a + mu_int * (b + mu_int * c))


PRESETS: Final[Mapping[str, Sand]] = {
    "poppy-seeds": Sand(
        rho_c=1100 * 0.58,
        mu_int=0.56,
        mu_surf=0.35,
        zeta=0.35e6,
        grain_diameter=1.1e-3,
        source="[Agarwal] Table 4.2: loose poppy seeds, rho_c = 1100 x 0.58",
    ),
    "glass-beads": Sand(
        rho_c=1410,
        mu_int=0.21,
        mu_surf=0.21,
        zeta=0.33e6,
        grain_diameter=3.2e-3,
        source="zeta of [Treers2021]; density and friction of [Agarwal] section 5.10",
    ),
    "dem-glass-beads": Sand(
        rho_c=1410,
        mu_int=0.21,
        mu_surf=0.21,
        xi_n=0.136e6,
        grain_diameter=3.2e-3,
        source="[Agarwal] section 5.10 and Table C.2: the beads of the DEM drills",
    ),
    "close-poppy-seeds": Sand(
        mu_int=1.0, mu_surf=0.35, zeta=0.55e6, grain_diameter=1.1e-3, source="CPS of [Agarwal2019], 45 deg"
    ),
    "medium-sand": Sand(mu_int=0.675, zeta=2.02e6, source="MS of [Agarwal2019], 34 deg"),
    "mojave-simulant": Sand(mu_int=0.700, zeta=3.05e6, source="MMS of [Agarwal2019], 35 deg; cohesion left out"),
    "loose-poppy-seeds-li": Sand(
        mu_surf=0.35, zeta=0.254e6, grain_diameter=0.7e-3, source="LP of [Li2013], its own vertical plate"
    ),
    "close-poppy-seeds-li": Sand(
        mu_surf=0.35, zeta=0.464e6, grain_diameter=0.7e-3, source="CP of [Li2013], its own vertical plate"
    ),
    "thesis-sand": Sand(
        rho_c=3000, mu_int=0.4, mu_surf=0.4, xi_n=0.92e6, source="[Agarwal] section 5.9: the ten shapes' medium"
    ),
}
"""Named sands; each says its source."""


def make_sand(sand: "Sand | str | Mapping[str, Any]") -> Sand:
    """Sand from whatever names it.

    Args:
        sand: A `Sand`, a preset's name, `key=value,...` (`preset=NAME` may start it), a TOML file, or a mapping.
            `xi_n=cubic` takes the cubic of [Agarwal] Fig. C-2 instead of Table C.1.

    Raises:
        SandError: No such preset or file, an unknown key, or a value out of range.
    """
    if isinstance(sand, Sand):
        return sand
    if isinstance(sand, Mapping):
        return _from_mapping(dict(sand))
    if not isinstance(sand, str):
        raise SandError(f"sand must be a Sand, a name, key=value,..., a .toml file or a mapping, not {sand!r}")
    if sand in PRESETS:
        return PRESETS[sand]
    return _from_mapping(read_parameters(sand))


def read_parameters(text: str) -> dict[str, Any]:
    """Parameters of a sand, as they stand in `key=value,...` or in a TOML file.

    Raises:
        SandError: It is neither, or the file cannot be read.
    """
    if "=" in text:
        pairs = [_pair(item) for item in text.split(",") if item.strip()]
        repeated = [key for key, _ in pairs if sum(key == other for other, _ in pairs) > 1]
        if repeated:
            raise SandError(f"{repeated[0]!r} is given twice in the sand {text!r}")
        return dict(pairs)
    if text.endswith(".toml"):
        return _read_toml(Path(text))
    raise SandError(f"no sand {text!r}; presets are {', '.join(PRESETS)}; or give key=value,... or a .toml file")


def _pair(item: str) -> tuple[str, str]:
    key, separator, value = item.partition("=")
    if not separator:
        raise SandError(f"{item!r} in the sand is not key=value")
    return key.strip(), value.strip()


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        table = tomllib.loads(path.read_text())
    except OSError as error:
        raise SandError(f"cannot read the sand file {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SandError(f"the sand file {path} is not TOML: {error}") from None
    return dict(table.get("sand", table))


def _from_mapping(parameters: dict[str, Any]) -> Sand:
    base = parameters.pop("preset", None)
    if base is not None and (not isinstance(base, str) or base not in PRESETS):
        raise SandError(f"no sand {base!r}; presets are {', '.join(PRESETS)}")
    for key in parameters:
        if key not in _DEFAULTS:
            raise SandError(f"sand has no parameter {key!r}; it has {', '.join(sorted(_DEFAULTS))}")
    if parameters.get("xi_n") == "cubic":
        preset = dataclasses.asdict(PRESETS[base]) if base else {"g": GRAVITY}
        known = {key: parameters.get(key, preset.get(key)) for key in ("rho_c", "mu_int", "g")}
        for key, value in known.items():
            if value is None:
                raise SandError(f"xi_n=cubic needs {key}")
        parameters["xi_n"] = xi_n_cubic(*(_finite(key, value) for key, value in known.items()))
    given: dict[str, Any] = {k: v if k == "source" else _finite(k, v) for k, v in parameters.items()}
    return PRESETS[base].replace(**given) if base else Sand(**given)


@dataclasses.dataclass(frozen=True)
class FreeSurface:
    """The plane that bounds the sand from above.

    Depth and the laws' "up" follow the normal. RFT was measured and fitted on level ground: on slopes it is
    uncalibrated.

    Attributes:
        height: Where the surface meets the world's z axis [m].
        normal: Its upward normal; made a unit vector.

    Raises:
        ValueError: The normal does not point upward.
    """

    height: float = 0.0
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        normal = np.asarray(self.normal, dtype=float)
        if normal.shape != (3,) or not np.isfinite(normal).all() or not normal[2] > 0.0:
            raise ValueError(f"the sand's normal must point upward, as (0, 0, 1) does, not {self.normal}")
        if not math.isfinite(self.height):
            raise ValueError(f"the sand's height must be finite, not {self.height}")
        unit = normal / np.linalg.norm(normal)
        object.__setattr__(self, "normal", tuple(unit.tolist()))

    @property
    def offset(self) -> float:
        """The product normal . x of the points x on the surface [m]."""
        return self.height * self.normal[2]
