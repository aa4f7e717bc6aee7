"""Draws the packages of eomgen on their floors into docs/packages.svg: `python tools/drawing.py`.

A package stands above all that it imports. An arrow is an import that does not follow from others:
`api` imports `run`, but also `sweep`, which imports `run`; so only `sweep` has the arrow.
"""

import ast
import html
import textwrap
from functools import cache
from pathlib import Path

from floors import imports, modules

DRAWING = Path(__file__).parent.parent / "docs" / "packages.svg"

BASE = "base"
"""What all others may use: drawn without arrows to it."""
WIDTH, ROW, HIGH, GAP = 1000, 74, 48, 16
WIDEST = 470
FONT = "font-family='Helvetica, Arial, sans-serif'"


@cache
def rooms() -> dict[str, list[str]]:
    """The modules of each room: a package or a module directly in `eomgen`, but not the way in by
    `import eomgen` or `python -m eomgen`.
    """
    found: dict[str, list[str]] = {}
    for name in modules():
        if name not in ("", "__main__"):
            found.setdefault(_room(name), []).append(name)
    return found


def _room(name: str) -> str:
    return name.split(".")[0]


@cache
def needs(room: str) -> frozenset[str]:
    """The rooms that a room imports from."""
    reached = {_room(other) for name in rooms()[room] for other in imports(name) if other}
    return frozenset(reached - {room})


@cache
def below(room: str) -> frozenset[str]:
    """The rooms that can be reached from a room."""
    return needs(room).union(*(below(other) for other in needs(room)))


@cache
def floor(room: str) -> int:
    """How many rooms lie one on another below a room."""
    if room == BASE:
        return 0
    return 1 + max((floor(other) for other in needs(room)), default=0)


def arrows(room: str) -> list[str]:
    """The rooms that it imports from and reaches in no other way."""
    own = needs(room) - {BASE}
    return sorted(o for o in own if not any(o in below(other) for other in own))


def about(room: str) -> str:
    """The first sentence of a room's docstring."""
    text = ast.get_docstring(ast.parse(modules()[room].read_text("utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())


def drawing() -> str:
    """The drawing as SVG. Same imports, same bytes."""
    levels = max(map(floor, rooms())) + 1
    height = levels * ROW + 2 * GAP
    boxes: dict[str, tuple[float, float, float]] = {}
    for level in range(levels):
        row = sorted(r for r in rooms() if floor(r) == level)
        wide = min(WIDEST, (WIDTH - GAP) / len(row) - GAP)
        left = (WIDTH - len(row) * (wide + GAP) + GAP) / 2
        for i, room in enumerate(row):
            boxes[room] = (left + i * (wide + GAP), height - GAP - level * ROW - HIGH, wide)
    parts = [
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {height}' {FONT}>",
        "<defs><marker id='head' viewBox='0 0 8 8' refX='7' refY='4' markerWidth='7' "
        "markerHeight='7' orient='auto'><path d='M0 1 L7 4 L0 7 z' fill='#5b6b7b'/></marker>"
        "</defs>",
        f"<rect width='{WIDTH}' height='{height}' fill='white'/>",
    ]
    for room in sorted(rooms()):
        x, y, wide = boxes[room]
        for other in arrows(room):
            u, v, far = boxes[other]
            a, b, top, foot = x + wide / 2, u + far / 2, y + HIGH, v
            bend = (foot - top) * 0.5
            parts.append(
                f"<path d='M{a:.0f} {top} C{a:.0f} {top + bend:.0f} {b:.0f} {foot - bend:.0f} "
                f"{b:.0f} {foot - 1}' fill='none' stroke='#5b6b7b' marker-end='url(#head)'/>"
            )
    for room, (x, y, wide) in sorted(boxes.items()):
        fill = "#e8f0fa" if len(rooms()[room]) > 1 else "#f4f4f0"
        parts.append(
            f"<rect x='{x:.0f}' y='{y}' width='{wide:.0f}' height='{HIGH}' rx='5' fill='{fill}' "
            "stroke='#5b6b7b'/>"
        )
        parts.append(
            f"<text x='{x + 8:.0f}' y='{y + 16}' font-size='13' font-weight='bold'>{room}</text>"
        )
        words = textwrap.wrap(about(room), int(wide / 5.8), max_lines=2, placeholder=" …")
        for i, line in enumerate(words):
            parts.append(
                f"<text x='{x + 8:.0f}' y='{y + 29 + 12 * i}' font-size='10'>"
                f"{html.escape(line, quote=False)}</text>"
            )
    return "\n".join([*parts, "</svg>\n"])


if __name__ == "__main__":
    DRAWING.write_text(drawing(), "utf-8")
