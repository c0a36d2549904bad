"""How the packages are built stays within the bounds of `house`; see there."""

import re
import subprocess
import sys

import grimp
import house
import pytest

EXCEPTED = {"project"}
"""Functions that may nest deeper, each with its reason above it in the code."""
PATHS = house.modules()
FUNCTIONS = [function for path in PATHS for function in house.functions(path)]
FLOORS = 12
"""Rooms of rftsim that stand on one another, at most."""
ROOMS = [path.parent.name for path in sorted((house.ROOT / "rftsim").glob("*/__init__.py"))] + ["errors", "files"]
PACKED = r"\b(sand|bed|body|header|surface|numbers|packed|table|block|frame|chosen)\[\d+(:\d+)?\]"
"""What a literal index into a packed array looks like."""
COMPILED = ("rftsim/law", "rftsim/solver", "rftsim/engine", "rftsim/machine")


def test_no_module_is_long():
    assert [path.name for path in PATHS if house.length(path) > house.LONGEST_MODULE] == []


def test_no_function_is_long():
    assert [one for one in FUNCTIONS if one.lines > house.LONGEST_FUNCTION] == []


def test_no_function_nests_deep():
    assert [one for one in FUNCTIONS if one.depth > house.DEEPEST and one.place.split()[1] not in EXCEPTED] == []


def test_functions_take_few_arguments():
    """The 90th percentile is at most four."""
    counts = sorted(one.arguments for one in FUNCTIONS)
    assert counts[int(0.9 * len(counts))] <= 4


def test_docstrings_are_sentences():
    assert [one for path in PATHS for one in house.docstrings(path) if house.is_fragment(one.text)] == []


def test_rooms_stand_on_few_floors():
    """The longest chain of rooms, each of which imports the next."""
    graph = grimp.build_graph("rftsim")
    below = {room: set() for room in ROOMS}
    for importer in graph.modules:
        for imported in graph.find_modules_directly_imported_by(importer):
            one, other = (name.split(".")[1] if "." in name else "" for name in (importer, imported))
            if one != other and one in below and other in below:
                below[one].add(other)

    def floors(room, above=()):
        assert room not in above, f"{' > '.join((*above, room))} is a circle"
        return 1 + max((floors(other, (*above, room)) for other in below[room]), default=0)

    assert max(map(floors, ROOMS)) <= FLOORS


def test_packed_arrays_are_read_by_name():
    """No literal index into packed sand, a surface, a block or a table, in any package."""
    found = [
        f"{path.relative_to(house.ROOT)}:{number}: {line.strip()}"
        for path in PATHS
        if str(path.relative_to(house.ROOT)).startswith("rftsim")
        for number, line in enumerate(path.read_text().splitlines(), 1)
        if re.search(PACKED, line)
    ]
    assert found == []


@pytest.mark.parametrize(
    ("rule", "home"),
    [
        (r"^def share\(", "rftsim/law/leading.py"),
        (r"^def may_lead\(", "rftsim/law/leading.py"),
        (r"^def plane_depth\(", "rftsim/law/free_surface.py"),
        (r"^def look\(", "rftsim/law/relief.py"),
        (r"^def reaches\(", "rftsim/law/ruts.py"),
        (r"^def dropped\(", "rftsim/law/wheel_drop.py"),
    ],
)
def test_each_rule_has_one_home(rule, home):
    """Whether a face leads, the depth and the normal of a point, the drop behind a wheel: one definition each."""
    found = [path for path in PATHS for _ in re.findall(rule, path.read_text(), re.MULTILINE)]
    assert [str(path.relative_to(house.ROOT)) for path in found if str(path).count("/rftsim/law/")] == [home]


def test_the_list_for_people_says_the_same():
    """The script prints a line for each exception, and the line that sums up."""
    said = subprocess.run([sys.executable, house.__file__], capture_output=True, text=True, check=True).stdout
    assert len(said.splitlines()) == len(EXCEPTED) + 1, said
