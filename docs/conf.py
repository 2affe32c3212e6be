"""Settings of Sphinx: ``make docs`` builds the pages into ``build/docs``, with warnings as errors."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE), str(HERE / "extensions")]

from flexcam import __version__  # noqa: E402 - needs the path above

project = "flexcam"
author = "The flexcam developers"
copyright = "the flexcam developers, MIT licence"  # noqa: A001 - Sphinx's name
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinxcontrib.bibtex",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    "backlinks",
    "bibliography",
    "cells",
    "figures",
    "mathml",
    "reference",
    "linking",
    "verification",
]
exclude_patterns = ["gallery/**/*.ipynb", "**/*.py", "extensions"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
nitpicky = True

# Markdown: formulas in dollars, and links to headings.
myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "attrs_block"]
myst_heading_anchors = 4
html_math_renderer = "mathml"

bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "sources"
bibtex_reference_style = "author_year"

# Names in single backquotes in a docstring are names of the code; public names become links.
default_role = "name"
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_type_aliases = {name: f"flexcam.core.{name}" for name in ("FloatArray", "IntArray", "ComplexArray")}
autodoc_preserve_defaults = True
add_module_names = False
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
python_display_short_literal_types = True
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
nitpick_ignore_regex = [
    (r"py:.*", r"(?!flexcam).*"),  # types of other packages: the build does not download their inventories
]

sphinx_gallery_conf = {
    "examples_dirs": str(HERE.parent / "examples"),
    "gallery_dirs": "gallery",
    "within_subsection_order": "figures.order",
    "notebook_extensions": set(),
    "filename_pattern": r"\.py$",
    "image_scrapers": ("figures.figures",),
    "reset_modules": (),
    "thumbnail_size": (600, 420),
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1e9,  # times differ from build to build
    "write_computation_times": False,
    "remove_config_comments": True,
}
copybutton_exclude = ".linenos, .gp, .go"

html_theme = "pydata_sphinx_theme"
html_title = f"flexcam {version}"
html_static_path = ["static"]
html_css_files = ["flexcam.css"]
html_show_sourcelink = False
html_theme_options = {
    "navbar_align": "left",
    "header_links_before_dropdown": 8,
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "navbar_end": ["theme-switcher"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}
