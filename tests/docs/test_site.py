"""The documentation site has every page, without Sphinx being needed. ``make docs`` builds it and checks the links."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from paths import ROOT

pytestmark = pytest.mark.fast

CONFIGURATION: dict[str, Any] = runpy.run_path(str(ROOT / "docs" / "conf.py"))
PAGES = {
    str(file.relative_to(ROOT).with_suffix(""))
    for pattern in CONFIGURATION["include_patterns"]
    for file in ROOT.glob(pattern.replace("**", "**/*"))
    if str(file.relative_to(ROOT)) not in CONFIGURATION["exclude_patterns"]
}


def _listed() -> list[str]:
    entries = [each for pages in CONFIGURATION["SIDEBAR"].values() for each in pages]
    below = [str(file.relative_to(ROOT).with_suffix("")) for glob in CONFIGURATION["BELOW"].values()
             for file in ROOT.glob(f"{glob}.md")]  # fmt: skip
    return entries + below


def test_every_page_is_in_the_sidebar_once() -> None:
    assert sorted([CONFIGURATION["root_doc"], *_listed()]) == sorted(PAGES)


def test_the_index_links_to_every_page_of_the_sidebar() -> None:
    links = set(re.findall(r"\]\(([^)#]+)\.md", (ROOT / "docs" / "index.md").read_text(encoding="utf-8")))
    linked = {str((ROOT / "docs" / link).resolve().relative_to(ROOT)) for link in links}
    assert linked == {each for pages in CONFIGURATION["SIDEBAR"].values() for each in pages}


def test_a_page_in_a_folder_that_is_listed_leads_to_the_pages_below_it() -> None:
    assert CONFIGURATION["BELOW"].keys() <= set(_listed())


@pytest.mark.parametrize("picture", sorted((ROOT / "docs").glob("tutorial-*.png")), ids=lambda path: path.stem)
def test_a_picture_of_the_tutorial_is_small_and_shown(picture: Any) -> None:
    assert picture.stat().st_size < 150_000
    with Image.open(picture) as opened:
        assert opened.width == 1080
    assert f"({picture.name})" in (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", ["README", *sorted(PAGES)])
def test_an_anchor_in_a_link_is_a_heading(page: str) -> None:
    file = ROOT / f"{page}.md"
    linked = re.findall(r"\]\((?!https?:)([^)#\s]*)#([^)\s]+)\)", _prose(file))
    missing = [
        f"{target}#{anchor}"
        for target, anchor in linked
        if anchor not in _anchors(file.parent / target if target else file)
    ]
    assert missing == []


def _prose(file: Path) -> str:
    return re.sub(r"```.*?```", "", file.read_text(encoding="utf-8"), flags=re.DOTALL)


def _anchors(file: Path) -> set[str]:
    """Return the anchors that GitHub and the site give to the headings of a page."""
    headings = re.findall(r"^#+ (.+)$", _prose(file), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}
