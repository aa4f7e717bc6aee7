"""Line drawings as SVG and as TikZ."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from html import escape
from typing import Any

from eomgen.show.mathml import decimal
from eomgen.show.notation import parsed
from eomgen.show.order import ordered_factors
from eomgen.show.tex import escaped, tex

Expr = Any
Point = tuple[float, float]
"""Right and up, in points of the drawing."""
STYLES = {
    "body": ("#8a99a8", 5.0, ""),
    "arm": ("#33658a", 1.3, ""),
    "axis": ("#777777", 0.9, ""),
    "force": ("#c2410c", 1.7, ""),
    "impulse": ("#c2410c", 1.5, "5 3"),
    "angle": ("#15803d", 1.1, ""),
    "thin": ("#777777", 0.8, "2 2"),
}
"""Colour, width and dashes."""
PER_CM = 36.0
"""Points of a drawing in a centimetre of TikZ."""


@dataclass(frozen=True)
class Line:
    """A line through points, with an arrow at its end or without."""

    points: tuple[Point, ...]
    style: str
    arrow: bool = False


@dataclass(frozen=True)
class Arc:
    """A circular arc between two angles, rad, with an arrow at its end or without."""

    centre: Point
    radius: float
    start: float
    end: float
    style: str
    arrow: bool = True

    def points(self) -> list[Point]:
        """Points along it."""
        n = max(4, int(abs(self.end - self.start) * 10))
        angles = (self.start + (self.end - self.start) * i / n for i in range(n + 1))
        (x, y), r = self.centre, self.radius
        return [(x + r * math.cos(a), y + r * math.sin(a)) for a in angles]


@dataclass(frozen=True)
class Dot:
    """A disc or a ring."""

    centre: Point
    radius: float
    filled: bool
    style: str = "axis"


@dataclass(frozen=True)
class Label:
    """A formula or a word whose middle, or whose `start`, is at a point."""

    at: Point
    text: Expr
    style: str = "axis"
    start: bool = False


Item = Line | Arc | Dot | Label


@dataclass(frozen=True)
class Drawing:
    """Items in a frame of a width and a height; the origin is its lower left corner."""

    width: float
    height: float
    title: str
    items: tuple[Item, ...] = field(default=())


def moved(item: Item, up: float) -> Item:
    """An item higher by so many points."""

    def shifted(p: Point) -> Point:
        return (p[0], p[1] + up)

    if isinstance(item, Line):
        return replace(item, points=tuple(map(shifted, item.points)))
    if isinstance(item, Label):
        return replace(item, at=shifted(item.at))
    return replace(item, centre=shifted(item.centre))


def svg(drawing: Drawing) -> str:
    """The drawing as an `svg` element."""
    w, h = drawing.width, drawing.height
    parts = [_svg_item(item, h) for item in drawing.items]
    inner = "\n".join(parts)
    return (
        f'<svg viewBox="0 0 {w:g} {h:g}" width="{w:g}" height="{h:g}" role="img" '
        f'font-size="13" font-family="serif">'
        f"<title>{escape(drawing.title)}</title>\n{inner}\n</svg>"
    )


def _svg_item(item: Item, height: float) -> str:
    if isinstance(item, Label):
        x, y = item.at
        colour = STYLES[item.style][0]
        anchor = "start" if item.start else "middle"
        text = item.text if isinstance(item.text, str) else None
        inner = escape(text) if text is not None else _svg_formula(item.text)
        return (
            f'<text x="{x:.1f}" y="{height - y + 4:.1f}" text-anchor="{anchor}" '
            f'fill="{colour}">{inner}</text>'
        )
    colour, width, dashes = STYLES[item.style]
    stroke = f'stroke="{colour}" stroke-width="{width:g}"'
    stroke += f' stroke-dasharray="{dashes}"' if dashes else ""
    if isinstance(item, Dot):
        x, y = item.centre
        fill = colour if item.filled else "var(--paper)"
        return (
            f'<circle cx="{x:.1f}" cy="{height - y:.1f}" r="{item.radius:g}" fill="{fill}" '
            f'stroke="{colour}" stroke-width="1.2"/>'
        )
    points = list(item.points) if isinstance(item, Line) else item.points()
    path = " ".join(f"{x:.1f},{height - y:.1f}" for x, y in points)
    caps = ' stroke-linecap="round" stroke-linejoin="round"'
    found = f'<polyline points="{path}" fill="none" {stroke}{caps}/>'
    if item.arrow:
        tips = " ".join(f"{x:.1f},{height - y:.1f}" for x, y in arrow_head(points))
        found += f'<polygon points="{tips}" fill="{colour}"/>'
    return found


def arrow_head(points: Sequence[Point]) -> list[Point]:
    """The triangle at the end of a line."""
    (x0, y0), (x, y) = points[-2], points[-1]
    length = math.hypot(x - x0, y - y0) or 1.0
    c, s = (x - x0) / length, (y - y0) / length
    back, side = 8.0, 3.2
    return [
        (x + 2 * c, y + 2 * s),
        (x - back * c - side * s, y - back * s + side * c),
        (x - back * c + side * s, y - back * s - side * c),
    ]


def _svg_formula(e: Expr) -> str:
    """A symbol, a product of symbols, or minus one, in one line."""
    if e.is_Symbol:
        return _svg_symbol(e.name)
    if e.could_extract_minus_sign():
        return "−" + _svg_formula(-e)
    if e.is_Mul:
        factors = ordered_factors(e)
        return "\u2009".join(_svg_formula(x) for x in factors)
    if e.is_Number:
        return escape(decimal(e)[0] if not e.is_Rational or e.is_Integer else f"{e.p}/{e.q}")
    return escape(str(e).replace("**", "^").replace("*", " ").replace("-", "−"))


def _svg_symbol(name: str) -> str:
    parts = parsed(name)
    style = ' font-style="italic"' if parts.single and parts.letter.isascii() else ""
    mark = {0: "", 1: "\u0307", 2: "\u0308"}[parts.dots]
    found = f"<tspan{style}>{escape(parts.letter + mark)}</tspan>"
    if parts.below:
        below = escape(", ".join(part.replace("_", " ") for part in parts.below))
        found += f'<tspan dy="4" font-size="75%">{below}</tspan><tspan dy="-4">\u200b</tspan>'
    return found


def tikz(drawing: Drawing) -> str:
    """The drawing as a `tikzpicture`."""
    lines = [f"\\begin{{tikzpicture}}[x={1 / PER_CM:.5f}cm,y={1 / PER_CM:.5f}cm]"]
    lines.append(f"\\useasboundingbox (0,0) rectangle ({drawing.width:g},{drawing.height:g});")
    lines += [_tikz_item(item) for item in drawing.items]
    return "\n".join([*lines, "\\end{tikzpicture}"])


def _tikz_item(item: Item) -> str:
    if isinstance(item, Label):
        x, y = item.at
        text = escaped(item.text) if isinstance(item.text, str) else f"${tex(item.text)}$"
        west = ", anchor=west, inner sep=0pt" if item.start else ""
        return f"\\node[text=eom{item.style}{west}] at ({x:.1f},{y:.1f}) {{\\footnotesize {text}}};"
    width = STYLES[item.style][1]
    options = f"eom{item.style}, line width={width * 0.6:.2f}pt"
    if isinstance(item, Dot):
        x, y = item.centre
        fill = f"eom{item.style}" if item.filled else "white"
        return (
            f"\\draw[eom{item.style}, fill={fill}] ({x:.1f},{y:.1f}) circle "
            f"[radius={item.radius:g}];"
        )
    options += ", dashed" if STYLES[item.style][2] else ""
    points = list(item.points) if isinstance(item, Line) else item.points()
    path = " -- ".join(f"({x:.1f},{y:.1f})" for x, y in points)
    found = f"\\draw[{options}, line cap=round] {path};"
    if item.arrow:
        tips = " -- ".join(f"({x:.1f},{y:.1f})" for x, y in arrow_head(points))
        found += f"\n\\fill[eom{item.style}] {tips} -- cycle;"
    return found


def tikz_colours() -> str:
    """The colours of the styles, for the head of a document."""
    return "\n".join(
        f"\\definecolor{{eom{style}}}{{HTML}}{{{colour[1:].upper()}}}"
        for style, (colour, _, _) in STYLES.items()
    )
