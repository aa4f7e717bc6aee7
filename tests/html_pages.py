"""HTML as a browser has it."""

import json
from functools import cached_property
from html.parser import HTMLParser
from typing import Any


class Page(HTMLParser):
    """Tags with attributes, scripts, and the text of the rest."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.text = ""
        self.feed(page)
        self.close()

    @cached_property
    def data(self) -> dict[str, Any]:
        """What the first script holds."""
        return json.loads(self.scripts[0])

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag == "script":
            self.scripts.append("")

    def handle_data(self, data: str) -> None:
        if self.cdata_elem == "script":
            self.scripts[-1] += data
        elif self.cdata_elem is None:
            self.text += data

    def of(self, tag: str, name: str) -> list[str | None]:
        """An attribute of all tags of a kind."""
        return [attrs[name] for kind, attrs in self.tags if kind == tag]
