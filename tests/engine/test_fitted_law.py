"""A law with a table of one's own: read once from its file, carried by the model, the same everywhere."""

import copy
import pickle

import mujoco
import numpy as np
import oracle
import pytest
from shapes import blob
from trees import BALL, SAND, sandy, spec_of

import rftsim
from rftsim.law.law_file import law_text, read_table
from rftsim.law.tables import TABLE_C3, TABLE_C4

FALL = 30


def bent(table, factor=1.3):
    """A table with the stress of another, some times larger."""
    return tuple((powers, tuple(factor * x for x in f)) for powers, f in table)


@pytest.fixture(params=[TABLE_C3, TABLE_C4], ids=["cubic", "quartic"])
def file(request, tmp_path):
    path = tmp_path / "my_sand.toml"
    path.write_text(law_text(bent(request.param), {"sand": {"xi_n": 2e5, "mu_surf": 0.3, "rho_c": 1500.0}}))
    return path


def fallen(model):
    data = mujoco.MjData(model)
    data.qvel[:3] = 0.2, 0.1, -0.5
    for _ in range(FALL):
        mujoco.mj_step(model, data)
    return np.concatenate([data.qpos, data.qvel, data.sensordata])


def test_file_gives_back_its_table(file):
    """What is written is read to the last digit, whatever the order of its terms."""
    table = read_table(file)
    assert table in (bent(TABLE_C3), bent(TABLE_C4))
    head, terms = file.read_text().split("terms = [\n")
    lines = terms.splitlines()[:-1]
    file.write_text("\n".join([head + "terms = [", *lines[::-1], "]"]))
    assert read_table(file) == table


def test_law_of_a_file_against_the_oracle(file):
    """A table 1.3 times the source's, under sand 1.3 times as weak: the oracle's stress, to 1e-10."""
    surface, v = blob(np.random.default_rng(0)), np.array([0.3, -0.2, -1.0])
    ours = rftsim.surface_force(
        surface, SAND.replace(xi_n=SAND.xi_n / 1.3), f"rft3d:{file}", position=(0, 0, -0.1), velocity=v
    )
    body = oracle.Body(surface.centres - [0, 0, 0.1], surface.normals, surface.areas, np.array([0, 0, -0.1]), v)
    law = oracle.rft3d if len(read_table(file)) == 20 else oracle.rft3d_c4
    theirs = law(body, SAND.xi_n, SAND.mu_surf)
    np.testing.assert_allclose(ours.stress, theirs.traction, rtol=0, atol=1e-10 * np.abs(theirs.traction).max())


@pytest.mark.parametrize("force", ["explicit", "implicit"])
@pytest.mark.parametrize("law", ["rft3d", "drft3d"])
def test_source_table_from_a_file_is_the_built_in_law(tmp_path, law, force):
    """Table C.3 through a file, bit for bit; the law's own table, and no other's, moves the body."""
    (tmp_path / "c3.toml").write_text(law_text(TABLE_C3, {}))
    (tmp_path / "c4.toml").write_text(law_text(TABLE_C4, {}))
    built_in, same, other = (
        fallen(sandy(law=name, force=force))
        for name in (law, f"{law}:{tmp_path / 'c3.toml'}", f"{law}:{tmp_path / 'c4.toml'}")
    )
    np.testing.assert_array_equal(same, built_in)
    np.testing.assert_array_equal(other, fallen(sandy(law=f"{law}:c4", force=force)))
    assert np.abs(other - built_in).max() > 1e-6


def test_model_needs_no_file_afterwards(file, tmp_path):
    """Copies, pickles and MJB run as the model does when the file is gone."""
    spec = spec_of(BALL)
    rftsim.add_sand(spec, str(file), f"rft3d:{file}")
    model = spec.compile()
    expected = fallen(model)
    mujoco.mj_saveModel(model, str(tmp_path / "model.mjb"))
    file.unlink()
    for clone in (
        copy.copy(model),
        pickle.loads(pickle.dumps(model)),
        mujoco.MjModel.from_binary_path(str(tmp_path / "model.mjb")),
    ):
        np.testing.assert_array_equal(fallen(clone), expected)
    assert np.abs(expected - fallen(sandy(sand=rftsim.Sand(xi_n=2e5, mu_surf=0.3), force="implicit"))).max() > 1e-4


def test_saved_xml_needs_no_file_afterwards(file):
    """The saved XML, of six digits, runs as the model does when the file is gone."""
    spec = spec_of(BALL)
    rftsim.add_sand(spec, str(file), f"rft3d:{file}", tolerance=1e-5)
    expected, xml = fallen(spec.compile()), spec.to_xml()
    file.unlink()
    found = fallen(mujoco.MjModel.from_xml_string(xml))
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-5)


def test_one_file_is_law_and_sand(file):
    """`[sand]` of a law file makes it a sand, too."""
    sand = rftsim.make_sand(str(file))
    assert (sand.xi_n, sand.mu_surf, sand.rho_c) == (2e5, 0.3, 1500.0)
    assert rftsim.load(spec_of(BALL).to_xml(), str(file), f"drft3d:{file}").nplugin == 1


DAMAGE = {
    "missing": (lambda text: None, "cannot read"),
    "not TOML": (lambda text: text.replace("terms = [", "terms = "), "is not TOML"),
    "binary": (lambda text: b"\xff\xfe\x00", "is not TOML"),
    "other TOML": (lambda text: "[sand]\nxi_n = 1e5\n", "needs \\[law\\]"),
    "degree": (lambda text: text.replace("degree = 3", "degree = 5"), "degree = 3 or 4"),
    "wrong degree": (lambda text: text.replace("degree = 3", "degree = 4"), "each of its 35 monomials once"),
    "row gone": (lambda text: text.replace("  [1, 1, 1,", "#"), r"\(1, 1, 1\) is missing"),
    "row twice": (lambda text: text.replace("terms = [", "terms = [ [1, 1, 1, 0, 0, 0],"), "one is there twice"),
    "short row": (lambda text: text.replace("[1, 1, 1,", "[1, 1,"), "three powers and three finite numbers"),
    "nan": (lambda text: text.replace("[1, 1, 1, ", "[1, 1, 1, nan, 0, 0], #"), "three finite numbers"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_files_are_refused_in_one_line(tmp_path, damage):
    """The message names the file and what is wrong with it."""
    path = tmp_path / "law.toml"
    change, words = DAMAGE[damage]
    text = change(law_text(TABLE_C3, {}))
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(rftsim.RftsimError, match=words) as error:
        sandy(law=f"rft3d:{path}")
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_laws_that_are_no_files_are_named():
    with pytest.raises(ValueError, match=r"rft3d:FILE.toml"):
        rftsim.surface_force(blob(np.random.default_rng(0)), SAND, "rft2d:my_sand.toml")
