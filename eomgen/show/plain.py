"""Formulas as text in two dimensions."""

from typing import Any

import sympy as sp
from sympy.printing.pretty.pretty import PrettyPrinter
from sympy.printing.pretty.pretty_symbology import pretty_use_unicode
from sympy.printing.pretty.stringpict import prettyForm, stringPict
from sympy.simplify.radsimp import fraction

from eomgen.show.mathml import decimal
from eomgen.show.notation import parsed
from eomgen.show.order import ordered_factors, ordered_terms

Expr = Any
MARKS = {0: "", 1: "\u0307", 2: "\u0308"}
"""Dots above the letter before."""


class PlainPrinter(PrettyPrinter):  # type: ignore[misc]
    """SymPy's printer with this project's names, decimals, and cross products."""

    @property
    def _use_unicode(self) -> bool:
        """As asked for; SymPy's own takes a flag of the process instead of False."""
        return bool(self._settings["use_unicode"])

    def doprint(self, expr: Expr) -> str:
        """The formula as text. SymPy's signs and brackets depend on a flag of the process."""
        before = pretty_use_unicode(self._use_unicode)
        try:
            return str(super().doprint(expr))
        finally:
            pretty_use_unicode(before)

    def _print_Symbol(self, e: Expr, bold_name: bool = False) -> Any:
        return prettyForm(self.name(e.name), binding=prettyForm.ATOM)

    def _print_MatrixSymbol(self, e: Expr) -> Any:
        return self._print_Symbol(e)

    def _print_Mul(self, e: Expr) -> Any:
        top, bottom = fraction(e, exact=True)
        if bottom != 1:
            return self._print(top) / self._print(bottom)
        factors = ordered_factors(e)
        number = sp.Mul(*(x for x in factors if x.is_Number))
        rest = [x for x in factors if not x.is_Number]
        return super()._print_Mul(
            sp.Mul(*((number,) if number != 1 else ()), *rest, evaluate=False)
        )

    def _as_ordered_terms(self, e: Expr, order: Any = None) -> list[Expr]:
        return ordered_terms(e)

    def name(self, name: str) -> str:
        """A name in one line: base, superscript after ^, subscripts after _."""
        parts = parsed(name)
        if not self._use_unicode:
            base = parts.base + {0: "", 1: "dot", 2: "ddot"}[parts.dots]
        elif len(parts.letter) == 1:
            base = parts.letter + MARKS[parts.dots]
        else:
            base = parts.letter + {0: "", 1: "˙", 2: "¨"}[parts.dots]
        above = f"^{parts.above}" if parts.above else ""
        return base + above + ("_" + ",".join(parts.below) if parts.below else "")

    def _print_Float(self, e: Expr) -> Any:
        digits, power = decimal(e)
        text = f"{digits}e{power}" if power else digits
        binding = prettyForm.NEG if digits.startswith("-") else prettyForm.ATOM
        return prettyForm(text, binding=binding)

    def _print_MotionCross(self, e: Expr) -> Any:
        return self._crossed(e, " × " if self._use_unicode else " x ")

    def _print_ForceCross(self, e: Expr) -> Any:
        return self._crossed(e, " ×* " if self._use_unicode else " x* ")

    def _crossed(self, e: Expr, sign: str) -> Any:
        a, b = (self._print(x) for x in e.args)
        if e.args[1].args and not e.args[1].is_Symbol:
            b = prettyForm(*b.parens())
        return prettyForm(*stringPict.next(a, sign, b), binding=prettyForm.MUL)

    def _print_BlockMatrix(self, e: Expr) -> Any:
        return self._print_MatrixBase(e.blocks)

    def _print_ZeroMatrix(self, e: Expr) -> Any:
        return prettyForm("0")

    def _print_Identity(self, e: Expr) -> Any:
        return prettyForm("1")

    def _print_Function(self, e: Expr, **keys: Any) -> Any:
        return super()._print_Function(e, **keys)


def printer(*, use_unicode: bool) -> PlainPrinter:
    """A printer that never breaks lines."""
    return PlainPrinter({"wrap_line": False, "use_unicode": use_unicode, "order": "none"})


def minus_signs(text: str) -> str:
    """The same with true minus signs. No name of a scene contains a hyphen."""
    return text.replace("-", "−")
