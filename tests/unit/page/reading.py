"""A page of the report read as text."""

import re
from html.parser import HTMLParser

VOID = {"meta", "br", "img", "input"}


class Page(HTMLParser):
    """Every tag closed in order; collects attributes and text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, str, str | None]] = []
        self.text = ""
        self.feed(html)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value) for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def section(html: str, name: str) -> str:
    found = re.search(rf'<section id="{name}">.*?</section>', html, re.DOTALL)
    assert found
    return found[0]


def rows(html: str, name: str) -> list[list[str]]:
    """The cells' texts of a section's table rows, heads left out."""
    part = re.sub(r"<svg.*?</svg>|<br>", " ", section(html, name), flags=re.DOTALL)
    found = re.findall(r"<tr>\s*(<td.*?)</tr>", part, re.DOTALL)
    return [[" ".join(Page(cell).text.split()) for cell in re.findall(r"<td.*?</td>", row, re.DOTALL)] for row in found]


def plain(html: str) -> str:
    """The text in one line."""
    return " ".join(Page(html).text.split())
