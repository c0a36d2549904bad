"""A force law as a file: what `rftsim fit map` writes, and what the laws `rft3d:FILE.toml` and `drft3d:FILE.toml` read.

    [law]
    degree = 3
    terms = [[0, 0, 0, 0.00212, -0.06796, -0.02634], ...]  # powers of x1, x2, x3; coefficients of f1, f2, f3

A `[sand]` beside it makes the same file a sand, see `sand.make_sand`; what else it holds is for people.
"""

import json
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rftsim.errors import RftsimError
from rftsim.law.tables import Term, monomials


def read_table(path: Path) -> tuple[Term, ...]:
    """The table of a law file, in the order of Tables C.3 and C.4.

    Raises:
        RftsimError: The file is missing, is no TOML, or its table is not one of third or fourth degree.
    """
    try:
        law = tomllib.loads(path.read_text()).get("law")
    except OSError as error:
        raise RftsimError(f"cannot read the law file {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RftsimError(f"the law file {path} is not TOML: {error}") from None
    if not isinstance(law, dict) or law.get("degree") not in (3, 4) or not isinstance(law.get("terms"), list):
        raise RftsimError(f"the law file {path} needs [law] with degree = 3 or 4 and terms: `rftsim fit map` writes it")
    wanted = monomials(law["degree"])
    terms = {}
    for term in law["terms"]:
        if not _is_term(term):
            raise RftsimError(f"the law file {path}: a term is three powers and three finite numbers, not {term}")
        terms[tuple(term[:3])] = (float(term[3]), float(term[4]), float(term[5]))
    if set(terms) != set(wanted) or len(law["terms"]) != len(wanted):
        odd = sorted(set(terms) ^ set(wanted))
        raise RftsimError(
            f"the law file {path}: a table of degree {law['degree']} has each of its {len(wanted)} monomials once; "
            + (f"{odd[0]} is missing, or does not belong" if odd else "one is there twice")
        )
    return tuple((powers, terms[powers]) for powers in wanted)


def _is_term(term: object) -> bool:
    numbers = (int, float)
    return (
        isinstance(term, list)
        and len(term) == 6
        and all(isinstance(x, numbers) and not isinstance(x, bool) and math.isfinite(x) for x in term)
    )


def law_text(table: tuple[Term, ...], sections: Mapping[str, Mapping[str, Any]]) -> str:
    """A law file: the table, and other sections, of which values that are None are left out."""
    degree = max(sum(powers) for powers, _ in table)
    text = [
        toml(sections),
        "[law]",
        f"degree = {degree}",
        "# powers of x1, x2, x3; coefficients of f1, f2, f3",
        "terms = [",
    ]
    text += [f"  {json.dumps([*powers, *coefficients])}," for powers, coefficients in table]
    return "\n".join([*text, "]", ""])


def toml(sections: Mapping[str, Mapping[str, Any]]) -> str:
    """TOML of sections of plain values; those that are None are left out."""
    lines = []
    for name, section in sections.items():
        values = [(key, value) for key, value in section.items() if value is not None]
        lines += [f"[{name}]", *(f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in values), ""]
    return "\n".join(lines)
