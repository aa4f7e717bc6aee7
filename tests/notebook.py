"""The cells of docs/howto/tour.ipynb, run one after the other, and what each shows."""

import ast
import html
import json
from functools import cache
from pathlib import Path
from typing import Any

TOUR = Path(__file__).parent.parent / "docs" / "howto" / "tour.ipynb"


@cache
def cells() -> tuple[str, ...]:
    """What each cell with code shows, as HTML: its last value by itself, or its text."""
    names: dict[str, Any] = {}
    notebook = json.loads(TOUR.read_text("utf-8"))
    sources = [c["source"] for c in notebook["cells"] if c["cell_type"] == "code"]
    return tuple(_shown("".join(source), names) for source in sources)


def _shown(source: str, names: dict[str, Any]) -> str:
    tree = ast.parse(source)
    last = tree.body.pop()
    assert isinstance(last, ast.Expr), source
    exec(compile(tree, "<cell>", "exec"), names)
    value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)
    shown = getattr(value, "_repr_html_", lambda: None)()
    return shown or f"<pre>{html.escape(repr(value))}</pre>"
