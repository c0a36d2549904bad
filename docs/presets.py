"""Print the shipped sands as a table in Markdown."""

import rftsim


def main() -> None:
    """Print a row for each preset: density, frictions, strengths, grain and source; a dash where none is published."""
    print("| preset | rho_c [kg/m³] | mu_int | mu_surf | xi_n [MN/m³] | zeta [MN/m³] | grain [mm] | source |")
    print("|---|---:|---:|---:|---:|---:|---:|---|")
    for name, sand in rftsim.PRESETS.items():
        scaled = (("rho_c", 1.0), ("mu_int", 1.0), ("mu_surf", 1.0), ("xi_n", 1e-6), ("zeta", 1e-6))
        cells = [_cell(getattr(sand, field), scale) for field, scale in (*scaled, ("grain_diameter", 1e3))]
        print(f"| `{name}` | {' | '.join(cells)} | {sand.source} |")
    print("\n    python docs/presets.py")


def _cell(value: float | None, scale: float) -> str:
    return "-" if value is None else f"{scale * value:.4g}"


if __name__ == "__main__":
    main()
