"""Named sands, and sand from whatever names it."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from rftsim.errors import SandError
from rftsim.files import read_toml
from rftsim.sand.medium import PARAMETERS, Sand, check_known, finite
from rftsim.sand.strength import GRAVITY, xi_n_cubic

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
    """The sand that a preset's name, parameters, a file or a mapping stand for.

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
    """Parameters of a sand by name, as they stand in `key=value,...` or in a TOML file.

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
        return _read_sand(Path(text))
    raise SandError(f"no sand {text!r}; presets are {', '.join(PRESETS)}; or give key=value,... or a .toml file")


def _pair(item: str) -> tuple[str, str]:
    key, separator, value = item.partition("=")
    if not separator:
        raise SandError(f"{item!r} in the sand is not key=value")
    return key.strip(), value.strip()


def _read_sand(path: Path) -> dict[str, Any]:
    text = read_toml(path, "sand", SandError)
    table = text.get("sand", text)
    if not isinstance(table, dict):
        raise SandError(f"the sand file {path} has sand = {table!r}; it needs a table [sand], or its parameters alone")
    return dict(table)


def _from_mapping(parameters: dict[str, Any]) -> Sand:
    base = parameters.pop("preset", None)
    if base is not None and (not isinstance(base, str) or base not in PRESETS):
        raise SandError(f"no sand {base!r}; presets are {', '.join(PRESETS)}")
    for key in parameters:
        check_known(key)
    if parameters.get("xi_n") == "cubic":
        preset = dataclasses.asdict(PRESETS[base]) if base else {"g": GRAVITY}
        known = {key: parameters.get(key, preset.get(key)) for key in ("rho_c", "mu_int", "g")}
        for key, value in known.items():
            if value is None:
                raise SandError(f"xi_n=cubic needs {key}")
        parameters["xi_n"] = xi_n_cubic(*(finite(key, value) for key, value in known.items()))
    given: dict[str, Any] = {k: finite(k, v) if k in PARAMETERS else v for k, v in parameters.items()}
    return PRESETS[base].replace(**given) if base else Sand(**given)
