"""An arena of sand for dm_control.composer: whatever is attached to it feels the sand."""

import copy
from collections.abc import Iterable, Mapping
from typing import Any, Literal

import mujoco
import numpy as np
from dm_control import composer, mjcf
from lxml import etree

from rftsim.law import layout
from rftsim.law.laws import Law
from rftsim.model.add_sand import WHOLE, add_sand
from rftsim.sand.medium import Sand

_SAND_RGB = ((0.78, 0.71, 0.52), (0.72, 0.64, 0.45))
_ALPHA = 0.7


class SandArena(composer.Arena):
    """A level bed of sand at z = 0, without a floor: the sand carries what is put on it.

    The sand is put under the model each time that it is compiled, so any `composer.Environment` and
    `mjcf.Physics.from_mjcf_model` have it; with `recompile_mjcf_every_episode=False` episodes start sooner. Each body
    that feels it gets a sensor `<body>_sand`: force, then moment about the body's origin, world frame.
    """

    def _build(
        self,
        sand: "Sand | str | Mapping[str, Any]" = "poppy-seeds",
        law: "Law | str" = "rft3d",
        size: tuple[float, float] = (8.0, 8.0),
        bodies: "Iterable[str] | str | None" = None,
        geoms: Literal["collision", "all"] = "collision",
        max_edge: float | None = None,
        force: Literal["implicit", "explicit"] = "implicit",
        tolerance: float = layout.TOLERANCE,
        iterations: int = layout.ITERATIONS,
        name: str = "sand",
    ) -> None:
        """Build the arena.

        Args:
            sand: The medium, see `rftsim.make_sand`.
            law: A law or its name.
            size: Half-lengths of the part that is drawn, and that tasks place things on [m].
            bodies: Full names of the bodies that feel the sand, as `walker/foot`; by default each that can move and
                has geoms.
            geoms: Which geoms bound a body: those that can collide, or all.
            max_edge: Longest edge of a triangle [m]; by default a sixth of each geom's size.
            force: `implicit` or `explicit`, see `rftsim.add_sand`.
            tolerance: Error of a body's velocity, relative, to which the implicit force is solved for, 1e-6 to 0.1.
            iterations: Most iterations of one such solution, 1 to 60.
            name: Name of the arena.
        """
        super()._build(name=name)
        self.size = size
        options = {
            "sand": sand,
            "law": law,
            "bodies": bodies if bodies is None or isinstance(bodies, str) else tuple(bodies),
            "geoms": geoms,
            "max_edge": max_edge,
            "force": force,
            "tolerance": tolerance,
            "iterations": iterations,
        }
        root = _SandyModel(options, self.mjcf_model)
        root.visual.headlight.set_attributes(ambient=[0.45] * 3, diffuse=[0.35] * 3)
        root.worldbody.add("light", pos=[0, -1, 4], dir=[0.3, 0.6, -1], directional=True, diffuse=[0.5] * 3)
        root.asset.add(
            "texture", name="sky", type="skybox", builtin="gradient", rgb1=[0.55, 0.7, 0.88], rgb2=[0.95, 0.96, 0.98],
            width=256, height=256,
        )  # fmt: skip
        checker = root.asset.add(
            "texture",
            name="sand",
            type="2d",
            builtin="checker",
            rgb1=_SAND_RGB[0],
            rgb2=_SAND_RGB[1],
            width=200,
            height=200,
        )
        material = root.asset.add(
            "material", name="sand", texture=checker, texuniform=True, texrepeat=[2, 2], rgba=[1, 1, 1, _ALPHA]
        )
        self._surface = root.worldbody.add(
            "geom", name="surface", type="plane", size=[*size, 0.25], material=material, contype=0, conaffinity=0
        )
        self._mjcf_root = root

    @property
    def ground_geoms(self) -> tuple[Any, ...]:
        """The geom of the drawn surface, which touches nothing."""
        return (self._surface,)

    def regenerate(self, random_state: np.random.RandomState) -> None:
        """Change nothing between episodes, though tasks of dm_control.locomotion call this."""

    def before_step(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        """Solve for the sand's force with the new controls.

        dm_control's step begins with mj_step2 and would take the force that went with the last controls.
        """
        if physics.legacy_step:
            with physics.check_invalid_state():
                mujoco.mj_step1(physics.model.ptr, physics.data.ptr)


class _SandyModel(mjcf.RootElement):
    """An MJCF model that has its sand wherever it is written out whole."""

    __slots__ = ("_options",)

    def __init__(self, options: dict[str, Any], content: mjcf.RootElement) -> None:
        super().__init__(model=content.model)
        self._options = options
        self.include_copy(content)

    def __copy__(self) -> "_SandyModel":
        return _SandyModel(self._options, self)

    def __str__(self) -> str:
        return f'<mujoco model="{self.model}">...</mujoco>'

    def to_xml(self, prefix_root: Any = None, *args: Any, **kwargs: Any) -> etree._Element:
        """The model as XML, with the sand where it is not written as a part of another model."""
        tree = super().to_xml(prefix_root, *args, **kwargs)
        if prefix_root in (None, self.namescope):
            put_sand(tree, self.get_assets(), self._options)
        return tree


def put_sand(tree: etree._Element, assets: Mapping[str, bytes], options: Mapping[str, Any]) -> None:
    """Write into an MJCF document what `rftsim.add_sand` writes into a spec.

    MuJoCo's own writer would do but for its six digits.

    Args:
        tree: The document; changed in place. Its bodies have names, as dm_control gives them.
        assets: Contents of the files that it refers to.
        options: Options of `rftsim.add_sand`.

    Raises:
        RftsimError: The scene cannot have sand.
    """
    spec = _bodies_alone(tree, assets)
    bed = add_sand(spec, draw=False, **{**WHOLE, **options})
    plugin = {"plugin": spec.body(next(iter(bed.surfaces))).plugin.plugin_name, "instance": bed.name}
    extension = etree.SubElement(etree.SubElement(tree, "extension"), "plugin", plugin=plugin["plugin"])
    etree.SubElement(extension, "instance", name=bed.name)
    elements = {body.get("name"): body for body in tree.find("worldbody").iter("body")}
    for body in bed.surfaces:
        etree.SubElement(elements[body], "plugin", plugin)
    custom, sensors = etree.SubElement(tree, "custom"), etree.SubElement(tree, "sensor")
    for numeric in spec.numerics:
        numbers = " ".join(map(repr, np.array(numeric.data).tolist()))
        etree.SubElement(custom, "numeric", name=numeric.name, data=numbers)
    for sensor in spec.sensors:
        etree.SubElement(sensors, "plugin", plugin, name=sensor.name, objtype="body", objname=sensor.objname)


def _bodies_alone(tree: etree._Element, assets: Mapping[str, bytes]) -> mujoco.MjSpec:
    """A spec of what the sand reads of a document, without what stands in it already and without what moves bodies."""
    document = copy.deepcopy(tree)
    for section in ("sensor", "contact", "tendon", "actuator", "equality", "keyframe", "custom"):
        for element in document.findall(section):
            document.remove(element)
    return mujoco.MjSpec.from_string(etree.tostring(document).decode(), assets=dict(assets))
