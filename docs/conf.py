"""Sphinx configuration: `make docs` builds docs/_build/html, offline, with warnings as errors."""

import os
import re
from importlib import metadata
from pathlib import Path
from typing import Any

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx

ROOT = Path(__file__).parents[1]

project = "jointsdf"
author = "jointsdf contributors"
copyright = "2026, jointsdf contributors"
release = version = metadata.version("jointsdf")

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
templates_path: list[str] = []

html_theme = "furo"
html_title = "jointsdf"
html_math_renderer = "mathml"  # written at build time: the pages need neither MathJax nor a network

myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3

os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"  # the notebook's figures go into its page
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_output_stderr = "remove"
os.environ.setdefault("OMP_NUM_THREADS", "2")  # for the notebook's kernel
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))

default_role = "code"  # docstrings name code in single backticks
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints = "signature"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

# Files outside docs/ that have a page here: links that a repository's visitor can follow lead to the page.
PAGES = {
    "../benchmarks/recipes.md": "recipe_trials.md",
    "../results/README.md": "committed_rows.md",
    "../CONTRIBUTING.md": "contributing.md",
    "../CHANGELOG.md": "changelog.md",
}


def link_pages(app: Sphinx, docname: str, source: list[str]) -> None:  # noqa: ARG001 (Sphinx's signature)
    """Point links at the pages of `PAGES`."""
    for path, page in PAGES.items():
        source[0] = source[0].replace(f"]({path})", f"]({page})")


def link_included(app: Sphinx, relative: Path, parent: str, content: list[str]) -> None:  # noqa: ARG001
    """The same in files that a page includes, whose links start where they lie."""
    root = Path(app.srcdir)
    folder = (root / relative).resolve().parent

    def from_here(match: re.Match[str]) -> str:
        path = os.path.relpath(folder / match[1], root)
        return f"]({PAGES.get(path, path)})" if (folder / match[1]).exists() else match[0]

    content[0] = re.sub(r"\]\(([^)\s:#]+)\)", from_here, content[0])


def escape_bars(app: Sphinx, kind: str, name: str, what: object, options: object, lines: list[str]) -> None:  # noqa: ARG001
    """Keep |x| in docstrings from being read as a reStructuredText substitution."""
    for i, line in enumerate(lines):
        outside = re.split(r"(`[^`]*`)", line)
        lines[i] = "".join(part if part.startswith("`") else part.replace("|", r"\|") for part in outside)


def visit_inline_math(self: Any, node: Any) -> None:
    """LaTeX -> MathML within a line."""
    self.body.append(tex2mathml(node.astext(), as_block=False))
    raise SkipNode


def visit_block_math(self: Any, node: Any) -> None:
    """LaTeX -> MathML on lines of its own."""
    self.body.append(f'<div class="math">{tex2mathml(node.astext(), as_block=True)}</div>')
    raise SkipNode


def setup(app: Sphinx) -> None:
    """Register the above."""
    app.connect("source-read", link_pages)
    app.connect("include-read", link_included)
    app.connect("autodoc-process-docstring", escape_bars, priority=900)  # after napoleon
    app.add_html_math_renderer("mathml", (visit_inline_math, None), (visit_block_math, None))
