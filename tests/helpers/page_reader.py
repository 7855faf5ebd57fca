"""Reads pages as browsers do, and lists their tags, attributes and text."""

from __future__ import annotations

from html.parser import HTMLParser

#: All tags that the templates write. Any other tag is a fault.
TAGS = {
    "html", "head", "meta", "title", "style", "body", "main", "header", "section", "footer", "div", "span", "p", "b",
    "i", "h1", "h2", "h3", "table", "thead", "tbody", "tfoot", "tr", "th", "td", "pre", "ol", "li", "dl", "dt", "dd",
    "svg", "rect", "figure", "figcaption", "img", "details", "summary", "a", "wbr", "script", "noscript", "caption",
}  # fmt: skip
ATTRIBUTES = {
    "lang", "charset", "http-equiv", "content", "name", "class", "scope", "role", "aria-label", "aria-hidden",
    "viewbox", "preserveaspectratio", "width", "height", "src", "alt", "href", "id", "type",
    "colspan", "tabindex", "data-before",
}  # fmt: skip
VOID = {"meta", "img", "rect", "wbr"}


class Reader(HTMLParser):
    """Collects tags, attributes and text, and checks that tags are nested correctly."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: set[str] = set()
        self.attributes: list[tuple[str, str, str]] = []
        self.text = ""
        self.style = ""
        self.scripts = 0
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self._open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] == "style":
            self.style += data
        elif self._open and self._open[-1] == "script":
            self.scripts += 1
        else:
            self.text += data

    def values(self, tag: str, name: str) -> list[str]:
        return [value for each, attribute, value in self.attributes if (each, attribute) == (tag, name)]
