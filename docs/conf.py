"""The site: Sphinx reads the MyST pages of this folder and the docstrings of the rooms (`make docs`)."""

import os
import sys
import tempfile
from importlib.metadata import version as installed_version
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_tools"))

# Kernels read this profile instead of the reader's own; they would otherwise warn that they talk over a local port.
PROFILES = tempfile.TemporaryDirectory(prefix="ipython-")
(Path(PROFILES.name) / "profile_default").mkdir()
(Path(PROFILES.name) / "profile_default" / "ipython_kernel_config.py").write_text("c.IPKernelApp.log_level = 40\n")
os.environ["IPYTHONDIR"] = PROFILES.name
# A backend chosen outside would leave the pictures out of the pages.
os.environ.pop("MPLBACKEND", None)

project = "piezo-bender"
author = "The piezo-bender developers"
project_copyright = author
release = installed_version("piezo-bender")
version = release

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "api_pages", "mathml"]
exclude_patterns = ["_tools"]
# What a program or a package of others uses; the rest is read in its source.
api_packages = [
    "piezo_bender",
    "bender_plant",
    "bender_loop.control",
    "bender_loop.records",
    "bender_hil.sources",
    "bender_hil.sensors",
    "bender_hil.supply",
    "bender_effects",
]

# Tutorials are executed in every build; a cell that fails fails the build.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # of a cell, on a busy machine
nb_merge_streams = True

myst_enable_extensions = ["colon_fence", "dollarmath", "tasklist"]
myst_heading_anchors = 4

# Every link inside the site has to lead somewhere; names from docstrings (numpy's types, private helpers) need not.
nitpicky = True
nitpick_ignore_regex = [(r"py:.*", r".*")]
default_role = "code"
# Two rooms may have a class of the same name; an annotation then links to neither.
suppress_warnings = ["ref.python"]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = False  # settings in signatures have defaults that stand in no source
autodoc_use_type_comments = False
napoleon_numpy_docstring = False
napoleon_use_ivar = True
python_display_short_literal_types = True
python_maximum_signature_line_length = 100
toc_object_entries = False
add_module_names = False

html_math_renderer = "mathml"
html_theme = "pydata_sphinx_theme"
html_title = f"piezo-bender {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_search_scorer = str(HERE / "_tools" / "search_scorer.js")
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navigation_with_keys": False,
    "show_prev_next": True,
    "show_toc_level": 2,
    "navigation_depth": 2,
    "header_links_before_dropdown": 6,
    "footer_start": ["copyright"],
    "footer_end": [],
}
