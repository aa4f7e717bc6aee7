"""Formulas and prose for LaTeX, as plain ASCII that `pdflatex` compiles."""

import re
import unicodedata
from typing import Any

from sympy.printing.latex import LatexPrinter
from sympy.simplify.radsimp import fraction

from eomgen.show.mathml import decimal
from eomgen.show.notation import GREEK, parsed
from eomgen.show.order import negative, ordered_factors, ordered_terms

Expr = Any
ACCENTS = {1: r"\dot", 2: r"\ddot"}
NAMES = {letter: name for name, letter in GREEK.items()}


class TexPrinter(LatexPrinter):  # type: ignore[misc]
    """SymPy's printer with this project's names, decimals, and cross products."""

    def _print_Symbol(self, e: Expr, style: str = "plain") -> str:
        return tex_symbol(e.name)

    def _print_MatrixSymbol(self, e: Expr, style: str = "plain") -> str:
        return tex_symbol(e.name)

    def _print_Mul(self, e: Expr) -> str:
        if negative(e):
            return f"- {self._product(-e)}"
        return self._product(e)

    def _product(self, e: Expr) -> str:
        top, bottom = fraction(e, exact=True)
        if bottom != 1:
            return rf"\frac{{{self._print(top)}}}{{{self._print(bottom)}}}"
        if not e.is_Mul:
            return str(self._print(e))
        parts = ((x, self._print(x)) for x in ordered_factors(e))
        return " ".join(rf"\left({text}\right)" if x.is_Add else text for x, text in parts)

    def _as_ordered_terms(self, e: Expr, order: Any = None) -> list[Expr]:
        return ordered_terms(e)

    def _print_Float(self, e: Expr) -> str:
        digits, power = decimal(e)
        return f"{digits} \\cdot 10^{{{power}}}" if power else digits

    def _print_MotionCross(self, e: Expr) -> str:
        return self._crossed(e, r"\times")

    def _print_ForceCross(self, e: Expr) -> str:
        return self._crossed(e, r"\times^{*}")

    def _crossed(self, e: Expr, sign: str) -> str:
        a, b = (self._print(x) if not x.args or x.is_Symbol else rf"\left({self._print(x)}\right)"
                for x in e.args)  # fmt: skip
        return f"{a} {sign} {b}"

    def _print_BlockMatrix(self, e: Expr) -> str:
        return str(self._print_MatrixBase(_Rows(e.blocks)))

    def _print_ZeroMatrix(self, e: Expr) -> str:
        return "0"

    def _print_Identity(self, e: Expr) -> str:
        return "1"

    def _print_Piecewise(self, e: Expr) -> str:
        lines = []
        for value, condition in e.args:
            when = r"\text{otherwise}"
            if not condition.is_Atom:
                when = rf"\text{{if }} {self._print(condition)}"
            lines.append(f"{self._print(value)} & {when}")
        return r"\begin{cases} " + r" \\ ".join(lines) + r" \end{cases}"

    def _print_Function(self, e: Expr, exp: Expr = None) -> str:
        name = type(e).__name__
        if name not in ("min", "max", "step"):
            return str(super()._print_Function(e, exp))
        inner = ", ".join(self._print(x) for x in e.args)
        text = rf"\operatorname{{{name}}}\left({inner}\right)"
        return f"{text}^{{{exp}}}" if exp is not None else text


class _Rows:
    """The blocks of a matrix, as the printer reads a matrix."""

    def __init__(self, blocks: Expr) -> None:
        self.blocks, self.rows, self.cols = blocks, blocks.rows, blocks.cols

    def __getitem__(self, at: Any) -> Expr:
        return self.blocks[at]


PRINTER = TexPrinter({"mat_delim": "(", "ln_notation": False, "max": 100})


def tex(e: Expr) -> str:
    """An expression."""
    return str(PRINTER.doprint(e))


def tex_symbol(name: str) -> str:
    """A name with its dots, superscript and subscripts."""
    parts = parsed(name)
    letter = parts.letter
    base = _letter(letter) if parts.single else rf"\mathrm{{{escaped(letter)}}}"
    if parts.dots:
        base = rf"{ACCENTS[parts.dots]}{{{base}}}"
    below = ",".join(_below(part) for part in parts.below)
    text = f"{base}_{{{below}}}" if below else base
    above = parts.above.replace("×", r"\times")
    return f"{text}^{{{above}}}" if above else text


def _letter(letter: str) -> str:
    return f"\\{NAMES[letter]}" if letter in NAMES else letter


def _below(part: str) -> str:
    if len(part) == 1:
        return _letter(part)
    return rf"\mathrm{{{escaped(part).replace(chr(92) + '_', chr(92) + ' ')}}}"


SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "<": r"$<$", ">": r"$>$", "|": r"$|$", "½": r"$\frac{1}{2}$", "²": "$^2$", "³": "$^3$",
    "⁻": "$^-$", "¹": "$^1$", "·": r"$\cdot$", "⋅": r"$\cdot$", "±": r"$\pm$", "∓": r"$\mp$",
    "×": r"$\times$", "≥": r"$\geq$", "≤": r"$\leq$", "≫": r"$\gg$", "≈": r"$\approx$",
    "→": r"$\to$", "π": r"$\pi$",
    "∞": r"$\infty$", "√": r"$\sqrt{\ }$", "∂": r"$\partial$", "∑": r"$\sum$", "−": "$-$",
    "–": "--", "—": "---", "…": r"\dots{}", "°": r"$^\circ$", "’": "'", "“": "``", "”": "''",
    "∗": r"$*$", "ᵀ": r"$^{\mathrm T}$", "·̇": r"$\cdot$", '"': "''",
    "\u00a0": "~", "ß": r"\ss{}", "ø": r"\o{}", "æ": r"\ae{}",
}  # fmt: skip
MARKS = {
    "\u0307": ("\\dot", "\\."), "\u0308": ("\\ddot", '\\"'), "\u0302": ("\\hat", "\\^"),
    "\u0300": ("\\grave", "\\`"), "\u0301": ("\\acute", "\\'"), "\u030a": ("\\mathring", "\\r"),
    "\u0303": ("\\tilde", "\\~"), "\u0327": ("", "\\c"), "\u030c": ("\\check", "\\v"),
}  # fmt: skip
"""Marks above a letter: in formulas, and in words."""


def escaped(text: str) -> str:
    """Text for LaTeX; a character that a plain document cannot show becomes a question mark."""
    plain = unicodedata.normalize("NFD", text)
    found = []
    for match in re.finditer(r"(.)([\u0300-\u036f]*)", plain, re.DOTALL):
        letter, marks = match[1], match[2]
        if not marks:
            opens = letter == '"' and plain[: match.start()][-1:] in ("", " ", "(")
            found.append("``" if opens else _character(letter))
            continue
        math, word = MARKS.get(marks[0], ("", ""))
        if letter in NAMES or (marks[0] in "\u0307\u0302" and math):
            found.append(f"${math}{{{_letter(letter)}}}$")
        elif word and letter.isascii():
            found.append(f"{word}{{{letter}}}")
        else:
            found.append(_character(letter))
    return "".join(found)


def _character(c: str) -> str:
    if c in NAMES:
        return f"$\\{NAMES[c]}$"
    if c in SPECIAL:
        return SPECIAL[c]
    if c == "ο" or not c.isascii():
        return "?"
    return c if c.isprintable() or c == "\n" else " "
