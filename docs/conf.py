"""The documentation as a site: `make docs`."""

from __future__ import annotations

import re
from typing import Any

from inverse_service import __version__

project = "inverse-service"
author = "The inverse-service authors"
release = version = __version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb"}
# The notebooks hold their outputs; tests/docs/notebooks.py executes them.
nb_execution_mode = "off"
html_theme = "pydata_sphinx_theme"
html_theme_options = {"show_prev_next": False, "navigation_with_keys": False}
html_title = "inverse-service"
myst_heading_anchors = 4
# Pages link to files of the repository, which are no pages of the site.
suppress_warnings = ["myst.xref_missing", "myst.header"]
autodoc_member_order = "bysource"
autodoc_typehints = "description"
highlight_language = "text"
# Primes and quotation marks of programs are copied from the pages.
smartquotes = False


def name_files(app: Any, page: str, source: list[str]) -> None:
    """Show the name of the file that a block is, which stands behind the language in its fence.

    Links to Markdown outside of the pages are downloads, as those to other files are by themselves.
    """
    fence = r"^```(json|yaml) (\S+\.\S+)$"
    source[0] = re.sub(fence, r"```{code-block} \1\n:caption: \2\n", source[0], flags=re.MULTILINE)
    outside = r"\[([^\]]+)\]\((\.\./[^)#]*inverse_service/[^)#]*\.md)(?:#[^)]*)?\)"
    source[0] = re.sub(outside, r"{download}`\1 <\2>`", source[0])


def setup(app: Any) -> None:
    app.connect("source-read", name_files)
