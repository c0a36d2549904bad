"""`rftsim fit`: from data to a law, or to the parameters of a sand."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from rftsim.cli.commands import Group
from rftsim.cli.options import Flag, Folder, Number, Output
from rftsim.cli.output import print_doubts, print_json, print_line, print_written
from rftsim.cli.results import draw, picture_in
from rftsim.errors import RftsimError
from rftsim.files import check_writable, replacing
from rftsim.fit import trials
from rftsim.fit.generic import Settings
from rftsim.fit.pictures import plot_map, plot_trial
from rftsim.fit.plates import Campaign, Plates, read_campaign, read_csv
from rftsim.fit.report import FOLDS, Report, report
from rftsim.law.law_file import law_text, toml
from rftsim.sand.medium import ALPHA_Z_PLATE, Sand, check_parameter
from rftsim.sand.presets import make_sand, read_parameters
from rftsim.sand.strength import xi_n_from_table


@dataclasses.dataclass(frozen=True)
class Map:
    """A whole law, f1, f2, f3 of 3D-RFT and xi_n, from square plates over beta, gamma and psi.

    Columns: beta, gamma, psi [deg], alpha_x, alpha_y, alpha_z [N/m^3], which is force over area and depth.

    Example: rftsim fit map plates.csv --mu-surf 0.4 -o my_sand.toml; then --law rft3d:my_sand.toml --sand my_sand.toml
    """

    data: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="DATA ..", help_behavior_hint="")]
    """Folders of rftsim-mpm's campaigns, or CSV files."""
    output: Output = None
    """Where the law and its sand are written, .toml."""
    degree: Annotated[Literal[3, 4], tyro.conf.arg(metavar="3|4")] = 3
    """Degree of the polynomials."""
    dissipative: Flag = False
    """Never add energy, at any orientation and motion."""
    prior: Number = None
    """Plates that the source's table counts for; by default whichever predicts held-back plates best."""
    rho_c: Number = None
    """Density [kg/m^3]: of a campaign's sands, or a CSV's."""
    mu_int: Number = None
    """Internal friction [-], likewise."""
    mu_surf: Number = None
    """Friction of plate and sand [-]; a CSV needs it."""
    plot: Folder = None
    """Folder for fit-map.png."""
    json: Flag = False
    """Print JSON."""

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Fit the data, print the result, write it and draw it."""
        if self.output:
            check_writable(self.output, ".toml")
        if self.prior is not None and not 0.0 <= self.prior < math.inf:
            raise RftsimError(f"prior must be zero or more plates, not {self.prior:g}")
        for name in ("rho_c", "mu_int", "mu_surf"):
            check_parameter(name, getattr(self, name))
        picture = picture_in(self.plot, "fit-map")
        plates, sand, campaigns = self._read()
        settings = Settings(self.degree, self.prior or 0.0, self.dissipative)
        with Console(stderr=True).status("fitting"):
            found = report(plates, settings, sand["mu_surf"], choose_prior=self.prior is None)
        sand |= {"xi_n": float(f"{found.generic.xi_n:.8g}"), "source": f"rftsim fit map, {plates.n} plates"}
        doubts = [note for one in campaigns for note in one.notes] + found.doubts()
        flat = [_flat(row) for one in campaigns for row in one.flat]
        summary = _summary(found, [str(path) for path in self.data])
        if self.output:
            with replacing(self.output) as temporary:
                temporary.write_text(
                    law_text(found.generic.table, {"sand": sand, "fit": {**summary, "doubts": doubts}})
                )
        draw(picture, plot_map, found, ", ".join(path.name for path in self.data))
        if self.json:
            worst = [one._asdict() for one in found.worst()]
            terms = [[*powers, *coefficients] for powers, coefficients in found.generic.table]
            text = {"sand": sand, **summary, "worst": worst, "flat": flat, "terms": terms}
            print_json({**text, "warnings": [*doubts, *warnings()]})
            return
        _print_map(found, sand, flat)
        console = Console()
        print_doubts(console, doubts)
        print_written(console, self.output, picture)

    def _read(self) -> tuple[Plates, dict[str, Any], list[Campaign]]:
        """The plates of all data, their one sand, and the campaigns."""
        named = {"rho": self.rho_c, "mu_int": self.mu_int, "mu_surf": self.mu_surf}
        wanted = {name: value for name, value in named.items() if value is not None}
        campaigns = [read_campaign(path, wanted) for path in self.data if path.is_dir()]
        tables = [read_csv(path) for path in self.data if not path.is_dir()]
        if not self.data:
            raise RftsimError("no data: name a campaign's folder or a CSV file")
        for campaign in campaigns:
            if campaign.sand != campaigns[0].sand:
                raise RftsimError(f"the campaigns are of different sands, {campaigns[0].sand} and {campaign.sand}")
        sand = campaigns[0].sand if campaigns else wanted
        if "mu_surf" not in sand:
            raise RftsimError("the friction between plate and sand is not known: pass --mu-surf")
        parts = [*(campaign.plates for campaign in campaigns), *tables]
        plates = Plates(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
        known = {"rho_c": sand.get("rho"), "mu_int": sand.get("mu_int"), "mu_surf": sand["mu_surf"]}
        return plates, {name: value for name, value in known.items() if value is not None}, campaigns


def _summary(found: Report, data: list[str]) -> dict[str, Any]:
    """The numbers of a fit that are written and printed, beside its table."""
    return {
        "data": data,
        "plates": found.plates.n,
        "plates_edge_on": found.edge_on,
        "normalisation": f"a flat plate pushed straight down has alpha_z = {ALPHA_Z_PLATE} xi_n, as in Table C.3",
        "prior_plates": found.settings.prior,
        "dissipative": found.settings.dissipative,
        "coefficients": found.settings.unknowns,
        "determined": found.rank,
        "condition": float(f"{found.generic.condition:.4g}"),
        "folds": min(FOLDS, found.plates.n),
        "error": _rounded(found.fitted.relative),
        "error_held_back": _rounded(found.held_back.relative),
        "error_of_the_source": _rounded(found.source.relative),
        "rms_xyz": [_rounded(x) for x in found.fitted.rms],
        "rms_xyz_held_back": [_rounded(x) for x in found.held_back.rms],
        "largest_power": _rounded(found.power),
    }


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")


def _print_map(found: Report, sand: Mapping[str, Any], flat: list[dict[str, float]]) -> None:
    console, settings = Console(), found.settings
    prior = f", the source's table counting as {settings.prior:g}" if settings.prior else ""
    console.print(
        f"{found.plates.n} plates ({found.edge_on} of them edge-on){prior}; {found.rank} of {settings.unknowns} "
        f"coefficients determined, condition {found.generic.condition:.3g}",
        highlight=False,
    )
    table = Table("error of the law", "all, of rms alpha", "x", "y", "z [xi_n]")
    kinds = {
        "on the plates": found.fitted,
        f"held back, {min(FOLDS, found.plates.n)} parts": found.held_back,
        f"Table C.{settings.degree}, scaled": found.source,
    }
    for name, one in kinds.items():
        table.add_row(name, f"{one.relative:.2%}", *(f"{x:.4f}" for x in one.rms))
    console.print(table)
    worst = Table("fitted worst: beta, gamma, psi [deg]", "measured x, y, z [xi_n]", "law", "error")
    for row in found.worst():
        angles = ", ".join(f"{x:g}" for x in row.angles)
        worst.add_row(angles, *(", ".join(f"{x:.3f}" for x in v) for v in (row.alpha, row.fitted)), f"{row.error:.3f}")
    console.print(worst)
    if flat:
        plates = Table("flat plate pushed down: mu_int", "mu_surf", "xi_n [N/m^3]", "Table C.1", "ratio")
        for plate in flat:
            plates.add_row(*(f"{plate[name]:.4g}" for name in ("mu_int", "mu_surf", "xi_n", "table", "ratio")))
        console.print(plates)
    console.print(f"largest alpha_gen . v: {found.power:.2g} xi_n", highlight=False)
    console.print(trials.sand_line({name: sand[name] for name in sand if name != "source"}), highlight=False)


def _flat(row: Mapping[str, float]) -> dict[str, float]:
    """A flat plate's xi_n, and that of Table C.1."""
    xi_n, table = row["alpha_z"] / ALPHA_Z_PLATE, xi_n_from_table(row["rho"], row["mu_int"])
    return {"mu_int": row["mu_int"], "mu_surf": row["mu_surf"], "xi_n": xi_n, "table": table, "ratio": xi_n / table}


@dataclasses.dataclass(frozen=True)
class _Trial:
    """The options that all trials have, and the way from their data to a sand."""

    data: tyro.conf.Positional[Path]
    """CSV file with one row for each reading; columns are named below."""
    known: Annotated[str, tyro.conf.arg(metavar="TEXT", help_behavior_hint="")] = ""
    """What is known of the sand: key=value,.. or a TOML file."""
    output: Output = None
    """Where the sand is written, .toml, for --sand."""
    plot: Folder = None
    """Folder for the picture."""
    json: Flag = False
    """Print JSON."""

    def estimate(self) -> trials.Found:
        """Estimate the sand's parameters from the data of the trial."""
        raise NotImplementedError

    def __call__(self, warnings: Callable[[], list[str]]) -> None:
        """Fit the data, print the result, write it and draw it."""
        kind = type(self).__name__.lower()
        if self.output:
            check_writable(self.output, ".toml")
        picture = picture_in(self.plot, f"fit-{kind}")
        found = self.estimate()
        parameters = _known(self.known) | found.parameters
        if "xi_n" in found.parameters and "zeta" not in found.parameters:
            parameters.pop("zeta", None)  # follows from xi_n
        if set(parameters) & {"xi_n", "zeta"} or {"rho_c", "mu_int"} <= set(parameters):
            make_sand(dict(parameters))  # refuses what cannot be
        elif self.output:
            raise RftsimError(f"a sand needs a strength to be written: pass --known xi_n=... with {self.data}")
        if self.output:
            rounded = {name: float(f"{value:.8g}") for name, value in parameters.items()}
            with replacing(self.output) as temporary:
                temporary.write_text(toml({"sand": {**rounded, "source": f"rftsim fit {kind}, {self.data.name}"}}))
        draw(picture, plot_trial, found, f"rftsim fit {kind} {self.data.name}")
        if self.json:
            estimates = {name: one._asdict() for name, one in found.estimates.items()}
            print_json({"estimates": estimates, "sand": parameters, "warnings": [*found.doubts, *warnings()]})
            return
        console = Console()
        table = Table("", "estimate", "95 % by Student's t", "95 % by bootstrap")
        for name, one in found.estimates.items():
            ends = (f"{low:.4g} to {high:.4g}" for low, high in ((one.low, one.high), (one.boot_low, one.boot_high)))
            table.add_row(f"{name} [{trials.UNITS[name]}]", f"{one.value:.4g}", *ends)
        console.print(table)
        print_doubts(console, found.doubts)
        print_line(console, trials.sand_line(parameters))
        print_written(console, self.output, picture)


@dataclasses.dataclass(frozen=True)
class Plate(_Trial):
    """Strength xi_n from a flat plate pushed straight down: F = 0.87574 xi_n A z.

    Columns: depth [m], force [N]; area [m^2] and test (a number) where there are several.

    Example: rftsim fit plate plate.csv --area 0.0028 --known rho_c=1330,mu_int=0.55
    """

    area: Number = None
    """Area of the plate [m^2], if the data have none."""

    def estimate(self) -> trials.Found:
        """Estimate the sand's parameters from the data of the trial."""
        return trials.pushed(self.data, self.area)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Drag(_Trial):
    """Inertial factor lambda, and the strength, from an upright plate dragged level: F = K z + lambda rho_c A v^2.

    Columns: depth of the plate's centre [m], speed [m/s], force along the motion [N]; area [m^2] and test (a number)
    where there are several.

    Example: rftsim fit drag drag.csv --area 0.016 --rho-c 900
    """

    rho_c: Annotated[float, tyro.conf.arg(metavar="X")]
    """Density of the sand [kg/m^3]."""
    area: Number = None
    """Area of the plate [m^2], if the data have none."""

    def estimate(self) -> trials.Found:
        """Estimate the sand's parameters from the data of the trial."""
        return trials.dragged(self.data, self.area, self.rho_c)


@dataclasses.dataclass(frozen=True)
class Friction(_Trial):
    """Friction mu_surf between sand and a plate that slides through it: tangential over normal force.

    Columns: normal, tangential [N]; or force_x, force_z [N] and beta [deg], for a plate whose normal is
    (sin beta, 0, -cos beta); test (a number) where there are several.

    Example: rftsim fit friction slide.csv --known xi_n=1.1e6
    """

    def estimate(self) -> trials.Found:
        """Estimate the sand's parameters from the data of the trial."""
        return trials.slid(self.data)


def _known(text: str) -> dict[str, float]:
    """Parameters of a sand that --known names."""
    given = read_parameters(text) if text else {}
    given.pop("source", None)
    names = [field.name for field in dataclasses.fields(Sand) if field.name != "source"]
    found = {}
    for name, value in given.items():
        if name not in names:
            raise RftsimError(f"--known takes {', '.join(names)}, not {name!r}")
        try:
            found[name] = float(value)
        except (TypeError, ValueError):
            raise RftsimError(f"--known: {name} must be a number, not {value!r}") from None
    return found


FIT: Final = Group(
    "From data to a law, or to a sand's parameters.\n\nExample: rftsim fit plate plate.csv --area 0.0028 -o sand.toml",
    {"map": Map, "plate": Plate, "drag": Drag, "friction": Friction},
)
