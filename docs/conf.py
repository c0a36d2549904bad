"""How the pages are built: `make docs`."""

import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
sys.path.insert(0, str(Path(__file__).parent))

project = PROJECT["name"]
release = version = PROJECT["version"]
copyright = "2026, the rftsim authors"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton", "docstrings"]
exclude_patterns = ["tables"]

default_role = "code"
highlight_language = "none"
nb_execution_mode = "off"  # `make notebooks` runs them, and a test
myst_heading_anchors = 4
copybutton_prompt_text = "$ "

autodoc_typehints = "description"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
napoleon_use_ivar = True
napoleon_use_rtype = False
nitpicky = True
nitpick_ignore_regex = [  # types of others, and those of ours that are no part of what is offered
    ("py:.*", r"(numpy|np|mujoco|collections|pathlib|gymnasium|dm_control|dm_env|stable_baselines3|rich|numba)\..*"),
    ("py:class", r"rftsim(_envs|_models|_mpm)?\..*"),
    ("py:class", r"[A-Za-z_]+"),
]

html_theme = "furo"
html_title = f"rftsim {release}"
html_static_path = ["style"]
html_css_files = ["tables.css"]
html_theme_options = {"navigation_with_keys": True}
