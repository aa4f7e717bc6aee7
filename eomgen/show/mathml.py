"""Formulas as MathML Core, which browsers draw without a font of their own.

Brackets around what is high are borders of the style sheet: they stretch with any font.
"""

from collections.abc import Sequence
from html import escape
from typing import Any

import sympy as sp
from sympy.simplify.radsimp import fraction

from eomgen.derivation.spatial import ForceCross, MotionCross
from eomgen.show.notation import parsed
from eomgen.show.order import negative, ordered_factors, ordered_terms

Expr = Any
SUM, PRODUCT, POWER, ATOM = range(4)
"""How tightly an expression binds."""
DOTS = {1: "˙", 2: "¨"}
APART = '<mspace width="0.17em"></mspace>'
"""Between factors."""


def mathml(left: Expr, right: Expr) -> str:
    """The content of a `math` element for an equation."""
    return f"<mrow>{written(left)}<mo>=</mo>{written(right)}</mrow>"


def written(e: Expr) -> str:
    """An expression."""
    return _print(e)[0]


def symbol(name: str) -> str:
    """A name with its dots, superscript and subscripts."""
    parts = parsed(name)
    style = "" if parts.single else ' mathvariant="normal"'
    text = f"<mi{style}>{escape(parts.letter)}</mi>"
    if parts.dots:
        text = f"<mover>{text}<mo>{DOTS[parts.dots]}</mo></mover>"
    below = subscript(parts.below)
    tag = "mi" if parts.above.isalpha() else "mo"
    above = f"<{tag}>{escape(parts.above)}</{tag}>" if parts.above else ""
    if above and below:
        return f"<msubsup>{text}{below}{above}</msubsup>"
    if above:
        return f"<msup>{text}{above}</msup>"
    return f"<msub>{text}{below}</msub>" if below else text


def subscript(parts: Sequence[str]) -> str:
    """Subscripts with commas between them: words upright, single letters in italics."""
    found = []
    for part in parts:
        one = len(part) == 1 and part.isalpha()
        found.append(
            f"<mi>{part}</mi>" if one else f"<mtext>{escape(part.replace('_', ' '))}</mtext>"
        )
    inner = "<mo>,</mo>".join(found)
    return f"<mrow>{inner}</mrow>" if len(found) > 1 else inner


def _print(e: Expr) -> tuple[str, int]:
    if isinstance(e, sp.MatrixBase):
        return _matrix([[written(x) for x in row] for row in e.tolist()]), ATOM
    if isinstance(e, sp.BlockMatrix):
        blocks = e.blocks
        rows = [[written(blocks[i, j]) for j in range(blocks.cols)] for i in range(blocks.rows)]
        return _matrix(rows), ATOM
    if isinstance(e, sp.MatrixSymbol | sp.Symbol):
        return symbol(e.name), ATOM
    if isinstance(e, sp.ZeroMatrix | sp.Identity):
        return f"<mn>{int(isinstance(e, sp.Identity))}</mn>", ATOM
    if isinstance(e, MotionCross | ForceCross):
        sign = "<mo>×</mo>" if isinstance(e, MotionCross) else "<msup><mo>×</mo><mo>∗</mo></msup>"
        a, b = (_bracketed(x, ATOM) for x in e.args)
        return f"{a}{sign}{b}", PRODUCT
    if isinstance(e, sp.Transpose):
        return f'<msup>{_bracketed(e.arg, ATOM)}<mi mathvariant="normal">T</mi></msup>', POWER
    if isinstance(e, sp.Inverse):
        minus = "<mrow><mo>−</mo><mn>1</mn></mrow>"
        return f"<msup>{_bracketed(e.arg, ATOM)}{minus}</msup>", POWER
    if e.is_Number:
        return _number(e)
    if e is sp.pi:
        return "<mi>π</mi>", ATOM
    if e.is_Add:
        return _sum(terms_of(e)), SUM
    if e.is_Mul:
        return _product(e)
    if e.is_Pow:
        return _power(e)
    if isinstance(e, sp.Piecewise):
        return _cases(e), SUM
    if isinstance(e, sp.core.relational.Relational):
        sign = {"<": "&lt;", ">": "&gt;"}.get(e.rel_op, e.rel_op)
        return f"{written(e.lhs)}<mo>{sign}</mo>{written(e.rhs)}", SUM
    return _function(e)


def terms_of(e: Expr) -> Sequence[Expr]:
    """The terms of a sum in the order in which they are written."""
    if isinstance(e, sp.MatAdd):
        return tuple(e.args)
    return tuple(ordered_terms(e)) if isinstance(e, sp.Add) else (e,)


def _sum(terms: Sequence[Expr]) -> str:
    parts = []
    for i, term in enumerate(terms):
        minus = negative(term)
        text = _bracketed(-term if minus else term, PRODUCT)
        form = "" if i else ' form="prefix"'
        sign = f"<mo{form}>−</mo>" if minus else "<mo>+</mo>" if i else ""
        parts.append(sign + text)
    return "".join(parts)


def _product(e: Expr) -> tuple[str, int]:
    if negative(e):
        return f'<mo form="prefix">−</mo>{_bracketed(-e, PRODUCT)}', SUM
    if isinstance(e, sp.MatMul):
        return APART.join(_bracketed(x, POWER) for x in e.args if x != 1), PRODUCT
    top, bottom = fraction(e, exact=True)
    if bottom != 1:
        return f"<mfrac>{_row(top)}{_row(bottom)}</mfrac>", POWER
    factors = [_bracketed(x, POWER) for x in ordered_factors(e)]
    return APART.join(factors), PRODUCT


def _row(e: Expr) -> str:
    return f"<mrow>{written(e)}</mrow>"


def _number(e: Expr) -> tuple[str, int]:
    if e.is_Rational and not e.is_Integer:
        top, bottom = e.p, e.q
        sign = "<mo>−</mo>" if top < 0 else ""
        text = f"{sign}<mfrac><mn>{abs(top)}</mn><mn>{bottom}</mn></mfrac>"
        return text, SUM if top < 0 else POWER
    digits, power = decimal(e)
    text = f"<mn>{digits.removeprefix('-')}</mn>"
    if power:
        raised = f"<mn>{abs(power)}</mn>"
        raised = f"<mrow><mo>−</mo>{raised}</mrow>" if power < 0 else raised
        text += f"<mo>·</mo><msup><mn>10</mn>{raised}</msup>"
    if digits.startswith("-"):
        return f"<mo>−</mo>{text}", SUM
    return text, PRODUCT if power else ATOM


def decimal(e: Expr) -> tuple[str, int]:
    """Six digits of a number, and its power of ten if that is written."""
    if e.is_Integer:
        return str(int(e)), 0
    mantissa, _, power = f"{float(e):.6g}".partition("e")
    return mantissa, int(power or 0)


def _power(e: Expr) -> tuple[str, int]:
    base, power = e.args
    if power == sp.Rational(1, 2):
        return f"<msqrt>{written(base)}</msqrt>", ATOM
    if power.could_extract_minus_sign():
        return f"<mfrac><mn>1</mn>{_row(base**-power)}</mfrac>", POWER
    raised = _row(power)
    if base.is_Function and type(base).__name__ not in ("Abs", "max", "min"):
        return _function(base, raised)[0], POWER
    return f"<msup>{_bracketed(base, ATOM)}{raised}</msup>", POWER


def _function(e: Expr, raised: str = "") -> tuple[str, int]:
    name = type(e).__name__
    if name == "Abs":
        return f'<mrow class="size">{written(e.args[0])}</mrow>', ATOM
    letters = f'<mi mathvariant="normal">{escape(name)}</mi>'
    head = f"<msup>{letters}{raised}</msup>" if raised else letters
    inner = "<mo>,</mo>".join(written(x) for x in e.args)
    return head + _brackets(inner), ATOM


def _bracketed(e: Expr, least: int) -> str:
    text, tight = _print(e)
    if tight >= least:
        return f"<mrow>{text}</mrow>" if text.count("<m") > 1 else text
    return _brackets(text)


def _brackets(inner: str) -> str:
    """Round brackets; around what is high they are borders."""
    if any(tag in inner for tag in ("<mfrac", "<mtable", "<msqrt")):
        return f'<mrow class="high">{inner}</mrow>'
    return f'<mrow><mo stretchy="false">(</mo>{inner}<mo stretchy="false">)</mo></mrow>'


def _matrix(rows: Sequence[Sequence[str]]) -> str:
    lines = "".join("<mtr>" + "".join(f"<mtd>{x}</mtd>" for x in row) + "</mtr>" for row in rows)
    return f'<mrow class="matrix"><mtable displaystyle="true">{lines}</mtable></mrow>'


def _cases(e: Expr) -> str:
    lines = ""
    for value, condition in e.args:
        when = "<mtext>otherwise</mtext>"
        if not condition.is_Atom:
            when = f"<mtext>if&#160;</mtext>{written(condition)}"
        lines += f"<mtr><mtd>{written(value)}</mtd><mtd>{when}</mtd></mtr>"
    return f'<mrow class="cases"><mtable displaystyle="true">{lines}</mtable></mrow>'
