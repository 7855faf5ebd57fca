"""Settings of Sphinx for the documentation site. ``make docs`` builds it into ``site/``.

The sources are the Markdown files of ``docs/`` and of the top folder, as they are read on GitHub. So the source folder
is the top folder, and links between all of these pages work in both places.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_ROOT = Path(__file__).parent.parent

#: The pages in the sidebar. They are not in the Markdown files, where GitHub would show them as code.
SIDEBAR = {
    "Start": ["docs/tutorial", "docs/marks", "docs/statements"],
    "Students": ["docs/students", "docs/notebook", "docs/replay"],
    "Instructors": ["docs/web", "docs/instructors", "docs/criteria", "docs/models", "docs/recognition"],
    "Operators": ["docs/operators", "docs/performance", "docs/threat-model", "docs/sandbox", "SECURITY"],
    "Programmers": [
        "docs/api",
        "docs/python",
        "docs/how-it-works",
        "docs/decisions/index",
        "CONTRIBUTING",
        "CHANGELOG",
    ],
}
#: The pages below other pages.
BELOW = {"docs/decisions/index": "docs/decisions/0*"}

project = "Robomark"
version = release = tomllib.loads((_ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
html_title = f"Robomark {version}"

extensions = ["myst_parser"]
root_doc = "docs/index"
include_patterns = ["docs/**.md", "*.md"]
# The index takes the place of the README. Other folders are not searched for pages: some hold thousands of files.
exclude_patterns = ["README.md", *(path.name for path in _ROOT.iterdir() if path.is_dir() and path.name != "docs")]

# Anchors are those of GitHub.
myst_heading_anchors = 4

html_theme = "furo"
html_copy_source = False
html_show_copyright = False


def _add_sidebar(_app: Sphinx, page: str, source: list[str]) -> None:
    """Add the tables of contents to the source of a page."""
    tables = SIDEBAR if page == root_doc else {"All decisions": [BELOW[page]]} if page in BELOW else {}
    for caption, pages in tables.items():
        entries = "\n".join(f"/{each}" for each in pages)
        source[0] += f"\n```{{toctree}}\n:hidden:\n:glob:\n:caption: {caption}\n\n{entries}\n```\n"


def _add_entry(app: Sphinx, _error: Exception | None) -> None:
    """Write the entry page of the site, which leads to the index."""
    page = f'<!doctype html><title>{html_title}</title><meta http-equiv="refresh" content="0; url={root_doc}.html">'
    Path(app.outdir, "index.html").write_text(page, encoding="utf-8")


def setup(app: Sphinx) -> None:
    """Register the functions above with Sphinx."""
    app.connect("source-read", _add_sidebar)
    app.connect("build-finished", _add_entry)
