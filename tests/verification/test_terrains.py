"""What names a surface of sand: functions, dunes, pictures, arrays and texts; and what is none."""

import math
import re

import mujoco
import numpy as np
import pytest
from PIL import Image

from rftsim import FreeSurface, SandError, Terrain, dunes, load_terrain, make_terrain
from rftsim.sand.medium import STEEPEST

RNG = np.random.default_rng(0)
PLACES = RNG.uniform(-3.0, 3.0, size=(2, 200))


def plane_heights(x, y):
    return 0.1 + 0.2 * x - 0.3 * y


# Functions ------------------------------------------------------------------------------------------------------------


def test_a_function_is_met_where_it_was_sampled():
    """The terrain passes through the function at each of its values, and a plane is met everywhere."""
    made = Terrain.from_function(lambda x, y: np.sin(2 * x) * np.cos(y), (4.0, 6.0), 0.5, centre=(1.0, -1.0))
    x, y = np.meshgrid(np.linspace(-1.0, 3.0, 9), np.linspace(-4.0, 2.0, 13))
    assert made.window == ((-1.0, -4.0), (3.0, 2.0))
    np.testing.assert_allclose(made.height_at(x, y), np.sin(2 * x) * np.cos(y), atol=1e-14)
    flat = Terrain.from_function(plane_heights, 6.0, 0.75)
    np.testing.assert_allclose(flat.height_at(*PLACES), plane_heights(*PLACES), atol=1e-14)


@pytest.mark.parametrize("halvings", [1, 2])
def test_a_function_is_met_to_third_order_between(halvings):
    """Quadratic splines miss a smooth function between its values by the cube of the spacing."""

    def error(spacing):
        made = Terrain.from_function(lambda x, y: np.sin(x) * np.sin(y), 2 * math.pi, spacing, repeat=True)
        return np.abs(made.height_at(*PLACES) - np.sin(PLACES).prod(axis=0)).max()

    spacing = math.pi / 8
    assert error(spacing / 2**halvings) == pytest.approx(error(spacing) / 8**halvings, rel=0.4)


def test_a_constant_function_is_level_sand():
    assert Terrain.from_function(lambda x, y: 0.3, 1.0, 0.5).height_at(9.0, -9.0) == pytest.approx(0.3)


@pytest.mark.parametrize("repeat", [False, True])
def test_the_steepest_slope_is_the_functions(repeat):
    """Of a sin(k x) it is a k within (k h)^2 / 12, of a plane the plane's; no point lies above the ceiling."""
    made = Terrain.from_function(lambda x, y: 0.1 * np.sin(2 * x) + 0 * y, 2 * math.pi, 0.1, repeat=repeat)
    assert math.tan(made.steepest) == pytest.approx(0.2, rel=1.1 * 0.2**2 / 12)
    assert Terrain.from_function(plane_heights, 4.0, 1.0).steepest == pytest.approx(math.atan(math.hypot(0.2, 0.3)))
    assert made.height_at(*PLACES).max() <= made.ceiling.height <= 0.101


@pytest.mark.parametrize("repeat", [False, True])
def test_coefficients_give_the_terrain_back(repeat):
    before = Terrain(RNG.normal(size=(5, 8)), (0.5, 0.25), (1.0, 2.0), repeat)
    after = Terrain.from_coefficients(before.coefficients, before.spacing, before.origin, repeat)
    np.testing.assert_allclose(after.heights, before.heights, atol=1e-14)
    np.testing.assert_allclose(after.coefficients, before.coefficients, atol=1e-13)


# Dunes ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("amplitude", "wavelength"), [(0.02, 1.0), (0.04, 2.0), (0.5, 30.0)])
def test_dunes_are_as_high_and_as_long_as_asked(amplitude, wavelength):
    """Root mean square of the heights; and the wave number where their power, summed over headings, is largest."""
    made = dunes(amplitude, wavelength, seed=3)
    assert np.sqrt((made.heights**2).mean()) == pytest.approx(amplitude)
    assert made.heights.mean() == pytest.approx(0.0, abs=1e-12)
    (dx, dy), (rows, columns) = made.spacing, made.heights.shape
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(columns, dx), np.fft.fftfreq(rows, dy)))
    power = np.abs(np.fft.fft2(made.heights)) ** 2
    edges = np.arange(0.05, 3.0, 0.1) / wavelength
    spectrum, _ = np.histogram(k, edges, weights=power)
    assert edges[spectrum.argmax()] <= 1.0 / wavelength <= edges[spectrum.argmax() + 1]
    assert np.average(k, weights=power) == pytest.approx(1.0 / wavelength, rel=0.05)


def test_dunes_repeat_without_a_seam():
    """A period further there are the same height and the same slope, across the edge too."""
    made = dunes(size=(8.0, 12.0), seed=1)
    x, y = PLACES
    np.testing.assert_allclose(made.height_at(x + 8.0, y - 24.0), made.height_at(x, y), atol=1e-12)
    np.testing.assert_allclose(made.normal_at(x - 16.0, y + 12.0), made.normal_at(x, y), atol=1e-12)
    edge, small = made.origin[0] + 8.0, 1e-7
    for at in (made.height_at, made.normal_at):
        np.testing.assert_allclose(at(edge - small, y), at(edge + small, y), atol=1e-5)


def test_the_same_seed_gives_the_same_dunes():
    assert (dunes(seed=7).heights == dunes(seed=7).heights).all()
    assert np.abs(dunes(seed=7).heights - dunes(seed=8).heights).max() > 0.04
    np.testing.assert_allclose(dunes(0.02, seed=7).heights, dunes(0.04, seed=7).heights / 2)


def test_dunes_beyond_the_angle_of_repose_are_refused_with_the_largest_that_are_not():
    with pytest.raises(
        ValueError, match=r"as steep as 4\d\.?\d* degrees, beyond the angle of repose of 35: .* at most"
    ) as told:
        dunes(0.1, 2.0)
    most = float(re.search(r"amplitude of ([\d.]+) m at most", str(told.value))[1])
    assert dunes(0.99 * most, 2.0).steepest == pytest.approx(STEEPEST, rel=0.02)
    with pytest.raises(ValueError, match="repose of 10"):
        dunes(repose=math.radians(10.0))


# Pictures and arrays --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("depth", [8, 16])
def test_a_picture_lies_as_in_mujocos_height_fields(tmp_path, depth):
    """Its upper edge is where y is greatest; black is low and white is high. MuJoCo takes 8 of 16 bits."""
    grey = RNG.integers(0, 256, size=(5, 7))
    grey.flat[[3, 17]] = 0, 255
    pixels = grey.astype(np.uint8) if depth == 8 else (257 * grey).astype(np.uint16)
    Image.fromarray(pixels).save(tmp_path / "hill.png")
    field = f'<hfield name="hill" file="{tmp_path}/hill.png" size="3 2 .5 .1"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><asset>{field}</asset></mujoco>")
    made = load_terrain(tmp_path / "hill.png", size=(6.0, 4.0), low=0.1, high=0.6)
    np.testing.assert_allclose(made.heights, 0.1 + 0.5 * model.hfield_data.reshape(5, 7), atol=1e-7)
    assert made.window == ((-3.0, -2.0), (3.0, 2.0))


def test_a_picture_of_16_bits_keeps_them(tmp_path):
    Image.fromarray(np.array([[0, 1], [65534, 65535]], np.uint16)).save(tmp_path / "fine.png")
    made = load_terrain(tmp_path / "fine.png", spacing=1.0, high=65.535)
    np.testing.assert_allclose(made.heights, [[65.534, 65.535], [0.0, 1e-3]], atol=1e-12)


@pytest.mark.parametrize("kind", ["npy", "npz", "csv"])
def test_arrays_hold_metres_and_their_first_row_is_the_least_y(tmp_path, kind):
    heights, path = RNG.normal(size=(4, 3)), tmp_path / f"heights.{kind}"
    if kind == "csv":
        np.savetxt(path, heights, delimiter=",", fmt="%.17g")
    else:
        (np.save if kind == "npy" else np.savez)(path, **{"arr" if kind == "npy" else "heights": heights})
    made = load_terrain(path, spacing=(0.5, 0.25), centre=(1.0, 0.0))
    assert (made.heights == heights).all()
    assert made.window == ((0.5, -0.375), (1.5, 0.375))


def test_a_file_may_say_where_its_heights_lie(tmp_path):
    before = dunes(size=8.0)
    path = tmp_path / "dunes.npz"
    np.savez(path, heights=before.heights, spacing=before.spacing, origin=before.origin, repeat=before.repeat)
    after = load_terrain(path)
    assert (after.height_at(*PLACES) == before.height_at(*PLACES)).all()


# Texts ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["0.25", " 0.25", "2.5e-1"])
def test_a_number_is_a_height(text):
    assert make_terrain(text) == make_terrain(0.25) == FreeSurface(0.25)


@pytest.mark.parametrize("heading", [0.0, 90.0, -120.0])
def test_a_slope_rises_along_its_heading(heading):
    made = make_terrain(f"slope=12,heading={heading},height=0.5")
    way = np.array([math.cos(math.radians(heading)), math.sin(math.radians(heading))])
    assert made.height_at(*way) == pytest.approx(0.5 + math.tan(math.radians(12.0)))
    assert made.height_at(0.0, 0.0) == 0.5
    assert made.height_at(-way[1], way[0]) == pytest.approx(0.5)


def test_dunes_and_files_by_a_text(tmp_path):
    made = make_terrain("dunes, amplitude=0.03, wavelength=1, size=8x4, seed=2")
    assert (made.heights == dunes(0.03, 1.0, (8.0, 4.0), seed=2).heights).all()
    path = tmp_path / "hill.csv"
    path.write_text("0, 1\n2, 3\n4, 5\n")
    made = make_terrain(f"{path},spacing=0.5x0.1,centre=-1x2,repeat=yes")
    assert (made.spacing, made.window, made.repeat) == ((0.5, 0.1), ((-1.25, 1.9), (-0.75, 2.1)), True)
    assert make_terrain(made) is made


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "hills",
            "no terrain 'hills': it must be a height [m], slope=DEGREES, dunes, or a file that ends in .png, .npy",
        ),
        ("", "no terrain ''"),
        ("nan", "no terrain 'nan'"),
        ("slope=95", "less than 90 degrees steep, not 95"),
        ("slope=steep", "slope must be a number, not 'steep'"),
        ("slope=5,way=3", "'way=3' in the terrain 'slope=5,way=3' is no option; there are slope, heading, height"),
        ("slope=5,slope=6", "'slope' is given twice"),
        ("dunes,high=2", "'high=2' in the terrain 'dunes,high=2' is no option; there are amplitude, wavelength, size"),
        ("dunes,amplitude=0", "amplitude must be positive, in metres, not 0"),
        ("dunes,seed=1.5", "a seed is a whole number, zero or more, not '1.5'"),
        ("dunes,size=1x2x3", "size must be a number, or two as AxB, not '1x2x3'"),
        ("dunes,size=3", "a field of 3 m is too small for dunes of 2 m: take a size of 4 m or more"),
        ("dunes,spacing=1.5,size=9", "a spacing of 1.5 m is too coarse for dunes of 2 m"),
        ("dunes,spacing=-1", "spacing must be positive"),
        ("gone.png,size=2,high=1", "no terrain file gone.png"),
        ("gone.npy,size=2,high=1", "low and high are those of black and white in a picture"),
        ("gone.csv,repeat=maybe", "repeat is yes or no, not 'maybe'"),
        ("gone.csv,centre=2", "centre must be a number, two as AxB, not '2'"),
    ],
)
def test_texts_that_name_none(text, words):
    """One line, which says what would have been right."""
    with pytest.raises(ValueError, match=re.escape(words)) as told:
        make_terrain(text)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("terrain", [True, None, [1.0, 2.0], {"height": 1.0}])
def test_things_that_are_none(terrain):
    with pytest.raises(SandError, match="terrain must be a height, a FreeSurface, a Terrain or a text, not a"):
        make_terrain(terrain)


FILES = {
    "junk.png": b"not a picture",
    "junk.csv": b"1,2\n3,four\n",
    "row.csv": b"1,2,3\n",
    "ragged.csv": b"1,2\n3\n",
    "empty.csv": b"# nothing\n",
    "junk.npy": b"\x93NUMPY",
    "hole.csv": b"1,2\n3,nan\n",
}


@pytest.mark.parametrize("name", FILES)
def test_files_that_hold_none(tmp_path, name):
    (tmp_path / name).write_bytes(FILES[name])
    with pytest.raises(ValueError, match=r"cannot be read|must hold rows and columns|needs finite heights") as told:
        load_terrain(tmp_path / name, size=1.0, **({"high": 1.0} if name.endswith("png") else {}))
    assert "\n" not in str(told.value)


def test_files_that_lack_something(tmp_path):
    Image.fromarray(np.zeros((3, 4, 3), np.uint8)).save(tmp_path / "colours.png")
    Image.fromarray(np.zeros((3, 4), np.uint8)).save(tmp_path / "grey.png")
    np.savez(tmp_path / "other.npz", z=np.zeros((3, 4)))
    (tmp_path / "hill.csv").write_text("0,1\n2,3\n")
    for name, options, words in (
        ("colours.png", {"size": 1.0, "high": 1.0}, r"in colours or with transparency \(RGB\): save it in greyscale"),
        ("grey.png", {"size": 1.0}, "give high, the height of white"),
        ("grey.png", {"high": 1.0}, "give the size of .*grey.png .*, or the spacing"),
        ("other.npz", {"size": 1.0}, "has no array 'heights'; it has z"),
        ("hill.csv", {}, "give the size of"),
        ("hill.csv", {"size": 1.0, "spacing": 1.0}, "give the size of"),
        ("hill.csv", {"size": -1.0}, "size must be positive"),
        ("hill.txt", {"size": 1.0}, "it must end in .png or .npy, .npz, .csv"),
    ):
        with pytest.raises(ValueError, match=words):
            load_terrain(tmp_path / name, **options)


def test_functions_that_give_none():
    with pytest.raises(ValueError, match=r"heights of the shape of x and y, not \(9,\)"):
        Terrain.from_function(lambda x, y: x[0], 4.0, 0.5)
    with pytest.raises(ValueError, match="needs finite heights"):
        Terrain.from_function(lambda x, y: np.full(x.shape, np.inf), 4.0, 0.5)
    with pytest.raises(ValueError, match="spacing must divide its size"):
        Terrain.from_function(plane_heights, 1.0, 3.0)
    with pytest.raises(ValueError, match="more than 4000000 values"):
        Terrain.from_function(plane_heights, 1000.0, 0.1)
