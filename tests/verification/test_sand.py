"""Sand: Table C.1, what follows from what, and the ways to name it."""

import dataclasses
import re

import numpy as np
import pytest

from rftsim import PRESETS, FreeSurface, RftsimWarning, Sand, SandError, make_sand
from rftsim.sand.medium import ALPHA_Z_PLATE, PARAMETERS, check_bounds, number
from rftsim.sand.strength import TABLE_C1, xi_n_cubic, xi_n_from_table

RHO_C = 3000.0


# Strength -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mu_int", "xi_n"), TABLE_C1[1:])
def test_table_c1_is_met(mu_int, xi_n):
    """Sand without a strength takes it from Table C.1, printed for rho_c = 3000 kg/m^3."""
    assert Sand(rho_c=RHO_C, mu_int=mu_int, mu_surf=0.0).xi_n == pytest.approx(xi_n, rel=1e-12)


def test_table_c1_is_interpolated():
    """Between its rows linearly, and proportional to rho_c and g: xi_n = rho_c g f(mu_int), eq. (5.5)."""
    assert xi_n_from_table(RHO_C, 0.35) == pytest.approx((0.51e6 + 0.92e6) / 2)
    assert xi_n_from_table(RHO_C, 0.05) == pytest.approx(0.13e6 / 2)
    assert xi_n_from_table(1500.0, 0.35, 2 * 9.81) == pytest.approx(xi_n_from_table(RHO_C, 0.35))


@pytest.mark.parametrize(("mu_int", "miss"), [(0.1, 0.34), (0.3, -0.07), (0.5, 0.11)])
def test_cubic_misses_the_table(mu_int, miss):
    """The cubic of Fig. C-2 misses Table C.1 by +34 % at 0.1, -7 % at 0.3 and +11 % at 0.5."""
    assert xi_n_cubic(RHO_C, mu_int) / xi_n_from_table(RHO_C, mu_int) - 1 == pytest.approx(miss, abs=0.01)


@pytest.mark.parametrize("mu_int", [0.0, -0.1, 0.91])
def test_table_c1_ends(mu_int):
    """Outside Table C.1 the strength itself is needed."""
    with pytest.raises(SandError, match=r"outside Table C\.1 \(0 to 0\.9\): give xi_n"):
        xi_n_from_table(RHO_C, mu_int)


def test_plate_joins_the_two_strengths():
    """A flat plate pushed down feels zeta = 0.87574 xi_n: each follows from the other, and both may be given."""
    assert Sand(xi_n=2e5).zeta == pytest.approx(0.87574 * 2e5)
    assert Sand(zeta=0.87574e5).xi_n == pytest.approx(1e5)
    both = Sand(xi_n=1.0, zeta=3.0)
    assert (both.xi_n, both.zeta) == (1.0, 3.0)


def test_plate_test():
    """Eq. (5.21): xi_n = F / (alpha_z A d); each measure must be positive."""
    sand = Sand.from_vertical_plate(87.574, 0.01, 0.1, mu_surf=0.2)
    assert (sand.xi_n, sand.mu_surf) == (pytest.approx(1e5), 0.2)
    for measures in ((0, 1, 1), (1, -1, 1), (1, 1, np.nan)):
        with pytest.raises(SandError, match=r"plate test's (force|area|depth) must be positive"):
            Sand.from_vertical_plate(*measures)


# Errors ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({}, "give xi_n, or zeta, or rho_c and mu_int"),
        ({"rho_c": 1000}, "needs a strength"),
        ({"xi_n": 0}, "xi_n must be positive, not 0"),
        ({"xi_n": -1}, "xi_n must be positive, not -1"),
        ({"zeta": 0}, "zeta must be positive"),
        ({"xi_n": 1, "rho_c": 0}, "rho_c must be positive"),
        ({"xi_n": 1, "mu_surf": -0.1}, "mu_surf must be zero or more, not -0.1"),
        ({"xi_n": 1, "lambda_": -1}, "lambda_ must be zero or more"),
        ({"xi_n": 1, "g": 0}, "g must be positive"),
        ({"xi_n": float("nan")}, "xi_n must be finite, not nan"),
        ({"xi_n": float("inf")}, "xi_n must be finite, not inf"),
        ({"xi_n": "soft"}, "xi_n must be a number, not 'soft'"),
        ({"rho_c": 1000, "mu_int": 1.2}, "outside Table C.1"),
    ],
)
def test_sand_that_cannot_be(parameters, words):
    """An error names the parameter, its bound and its value; it is a ValueError."""
    with pytest.raises(SandError, match=re.escape(words)):
        Sand(**{"mu_surf": 0.0} | parameters)
    assert issubclass(SandError, ValueError)


def test_a_parameter_is_stated_once():
    """Each parameter but the source is a number with a bound, which the field itself carries."""
    assert (*PARAMETERS, "source") == tuple(field.name for field in dataclasses.fields(Sand))
    for name in PARAMETERS:
        with pytest.raises(SandError, match=f"{name} must be (positive|zero or more), not -1"):
            Sand(**{"xi_n": 1.0, "mu_surf": 0.0} | {name: -1})


@pytest.mark.parametrize(
    ("bound", "words"),
    [({"above": 2.0}, "x must be above 2, not 2"), ({"at_least": 2.5}, "x must be 2.5 or more, not 2")],
)
def test_bounds_other_than_zero(bound, words):
    """A parameter may have any lower bound, and its message says which."""
    thing = dataclasses.make_dataclass("Thing", [("x", float, number(3.0, **bound))])
    with pytest.raises(SandError, match=words):
        check_bounds(dataclasses.fields(thing)[0], 2.0)


def test_dynamic_laws_need_a_density():
    """The inertial term of eq. (4.2) has rho_c in it."""
    with pytest.raises(SandError, match="need the sand's density: give rho_c"):
        Sand(xi_n=1.0).density()


def test_rougher_than_the_sand_is_doubtful():
    """The largest meaningful mu_surf is mu_int, section 5.5."""
    with pytest.warns(RftsimWarning, match=r"mu_surf = 0\.5 exceeds mu_int = 0\.4"):
        Sand(xi_n=1.0, mu_int=0.4, mu_surf=0.5)
    Sand(xi_n=1.0, mu_int=0.4, mu_surf=0.4)


@pytest.mark.parametrize("name", ["g", "mu_surf", "lambda_"])
def test_parameters_without_which_nothing_works_cannot_be_none(name):
    """None means unknown, where that is possible; elsewhere it is an error."""
    with pytest.raises(SandError, match=name):
        Sand(**{"xi_n": 1.0, name: None})


# Changes --------------------------------------------------------------------------------------------------------------

BASE = Sand(rho_c=RHO_C, mu_int=0.4, mu_surf=0.3, xi_n=1e6, zeta=2e6)


@pytest.mark.parametrize(
    ("changes", "xi_n", "zeta"),
    [
        ({"mu_surf": 0.1}, 1e6, 2e6),
        ({"g": 9.81 / 6}, 1e6 / 6, 2e6 / 6),
        ({"rho_c": 2 * RHO_C}, 2e6, 4e6),
        ({"mu_int": 0.5}, 1e6 * 1.58 / 0.92, 2e6 * 1.58 / 0.92),
        ({"xi_n": 3e6}, 3e6, 3e6 * ALPHA_Z_PLATE),
        ({"zeta": 3e6}, 3e6 / ALPHA_Z_PLATE, 3e6),
        ({"xi_n": 3e6, "zeta": 5e6, "g": 1.0}, 3e6, 5e6),
    ],
)
def test_replace(changes, xi_n, zeta):
    """Strengths follow what is changed, unless they are changed themselves."""
    changed = BASE.replace(**changes)
    assert (changed.xi_n, changed.zeta) == (pytest.approx(xi_n), pytest.approx(zeta))
    assert {name: getattr(changed, name) for name in changes} == pytest.approx(changes)
    assert (BASE.xi_n, BASE.mu_surf) == (1e6, 0.3)


def test_sand_is_frozen():
    """A sand cannot be changed in place."""
    with pytest.raises(dataclasses.FrozenInstanceError):
        BASE.xi_n = 2.0


# Names ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PRESETS)
def test_presets(name):
    """Each preset has both strengths, a friction that means something, and a source."""
    sand = make_sand(name)
    assert sand is PRESETS[name]
    assert 1e5 < sand.xi_n < 1e7
    assert 1e5 < sand.zeta < 1e7
    assert sand.mu_int is None or sand.mu_surf <= sand.mu_int
    assert sand.source


@pytest.mark.parametrize(
    ("name", "published"),
    [
        ("poppy-seeds", {"zeta": 0.35e6, "rho_c": 638.0, "mu_int": 0.56, "mu_surf": 0.35}),  # Table 4.2
        ("thesis-sand", {"xi_n": 0.92e6, "rho_c": 3000.0, "mu_int": 0.4, "mu_surf": 0.4}),  # section 5.9
        ("dem-glass-beads", {"xi_n": 0.136e6, "rho_c": 1410.0, "mu_int": 0.21}),  # section 5.10
    ],
)
def test_presets_are_as_published(name, published):
    """The thesis's media."""
    assert {key: getattr(PRESETS[name], key) for key in published} == pytest.approx(published)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("xi_n=1e6", {"xi_n": 1e6}),
        (" rho_c = 3000 , mu_int=0.4, mu_surf=0.1,", {"xi_n": 0.92e6, "mu_surf": 0.1}),
        ("xi_n=cubic,rho_c=3000,mu_int=0.4", {"xi_n": xi_n_cubic(3000, 0.4)}),
        ("xi_n=cubic,rho_c=3000,mu_int=0.4,g=1", {"xi_n": xi_n_cubic(3000, 0.4, 1.0), "g": 1.0}),
        ("preset=poppy-seeds,mu_surf=0.2", {"zeta": 0.35e6, "mu_surf": 0.2}),
        ("preset=poppy-seeds,zeta=1e6", {"zeta": 1e6, "rho_c": 638.0}),
    ],
)
def test_key_value(text, expected):
    """`key=value,...`, perhaps on top of a preset."""
    sand = make_sand(text)
    assert {key: getattr(sand, key) for key in expected} == pytest.approx(expected)


@pytest.mark.parametrize("change", ["g=1.62", "rho_c=1276", "mu_int=0.5"])
def test_key_value_on_top_of_a_preset(change):
    """What the strengths follow from may be changed in text as in Python."""
    key, value = change.split("=")
    assert make_sand(f"preset=poppy-seeds,{change}") == PRESETS["poppy-seeds"].replace(**{key: float(value)})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gravel", "no sand 'gravel'; presets are poppy-seeds"),
        ("xi_n=1,foo=2", "no parameter 'foo'; it has g, grain_diameter"),
        ("xi_n=1,foo", "'foo' in the sand is not key=value"),
        ("preset=gravel,g=1", "no sand 'gravel'"),
        ("xi_n=cubic,mu_int=0.4", "xi_n=cubic needs rho_c"),
        ("xi_n=much", "xi_n must be a number"),
        ("", "no sand ''"),
        ("nowhere.toml", "cannot read the sand file nowhere.toml: No such file"),
    ],
)
def test_names_of_no_sand(text, words):
    """An error says what would have been right."""
    with pytest.raises(SandError, match=re.escape(words)):
        make_sand(text)


@pytest.mark.parametrize("header", ["", "[sand]\n"])
def test_toml(tmp_path, header):
    """A TOML file, its parameters at the top or in a table."""
    path = tmp_path / "sand.toml"
    path.write_text(header + 'preset = "poppy-seeds"\nmu_surf = 0.2\n')
    assert make_sand(str(path)) == PRESETS["poppy-seeds"].replace(mu_surf=0.2)


def test_toml_that_is_none(tmp_path):
    """A file that is not TOML is named."""
    path = tmp_path / "sand.toml"
    for content in (b"mu_surf 0.2", b"\xff\xfe\x00"):
        path.write_bytes(content)
        with pytest.raises(SandError, match=r"sand\.toml is not TOML"):
            make_sand(str(path))


def test_mapping():
    """A mapping, and a Sand as it is."""
    assert make_sand({"preset": "poppy-seeds", "mu_surf": 0.2}).mu_surf == 0.2
    assert make_sand(BASE) is BASE


# The free surface -----------------------------------------------------------------------------------------------------


def test_free_surface():
    """The normal is made a unit vector, and `offset` is normal . x of the surface's points."""
    surface = FreeSurface(0.5, (3.0, 0.0, 4.0))
    assert surface.normal == pytest.approx((0.6, 0.0, 0.8))
    assert surface.offset == pytest.approx(np.dot(surface.normal, (0, 0, 0.5)))


def test_depth_below_the_free_surface():
    """Depth is the distance along the normal, positive below; of one point a number, of several an array."""
    surface = FreeSurface(0.5, (3.0, 0.0, 4.0))
    points = np.array([[0.0, 0.0, 0.5], [0.0, 7.0, -0.5], [1.0, 0.0, 0.5]])
    np.testing.assert_allclose(surface.depth(points), [0.0, 0.8, -0.6], atol=1e-15)
    assert surface.depth(points[1]) == pytest.approx(0.8)


@pytest.mark.parametrize("normal", [(0, 0, -1), (1, 0, 0), (0, 0, 0), (0, np.nan, 1), (0, 1)])
def test_free_surface_that_cannot_be(normal):
    """The normal must point upward."""
    with pytest.raises(ValueError, match="must point upward"):
        FreeSurface(0.0, normal)
    with pytest.raises(ValueError, match="must be finite"):
        FreeSurface(np.inf)
