"""The derivation as text for a terminal, as a LaTeX document, or as a web page."""

import textwrap
from typing import Any

import sympy as sp
from markupsafe import Markup
from sympy.printing.mathml import MathMLPresentationPrinter

from eomgen.derivation.steps import Equation, Step
from eomgen.templating import render

WIDTH = 100


def as_text(title: str, steps: tuple[Step, ...]) -> str:
    """All steps as plain text, formulas in SymPy's two-dimensional notation."""
    parts = [title, "=" * len(title), ""]
    for step in steps:
        parts += [f"{step.number} {step.title}", ""]
        parts += [*textwrap.wrap(step.words, WIDTH), ""] if step.words else []
        for equation in step.equations:
            parts += [textwrap.indent(text, "    ") + "\n" for text in _lines(equation)]
    return "\n".join(parts)


def _lines(equation: Equation) -> list[str]:
    """An equation, or entry by entry where a matrix would be too wide to read."""
    whole = sp.pretty(sp.Eq(equation.left, equation.right, evaluate=False), wrap_line=False)
    if _width(whole) <= WIDTH:
        return [str(whole)]
    if not isinstance(equation.right, sp.MatrixBase):
        return [_term_by_term(equation)]
    matrix, name = equation.right, equation.left
    entries = []
    for i in range(matrix.rows):
        for j in range(matrix.cols):
            index = f"{name}_{i + 1}{j + 1}" if matrix.cols > 1 else f"{name}_{i + 1}"
            left = sp.Symbol(index)
            entry = sp.Eq(left, matrix[i, j], evaluate=False)
            entries.append(str(sp.pretty(entry, wrap_line=False)))
    return entries


def _term_by_term(equation: Equation) -> str:
    """A long sum with each of its terms on a line of its own."""
    first, *others = sp.Add.make_args(equation.right)
    parts = [str(sp.pretty(sp.Eq(equation.left, first, evaluate=False), wrap_line=False))]
    for term in others:
        sign = "-" if term.could_extract_minus_sign() else "+"
        text = sp.pretty(
            sp.Eq(sp.Symbol(sign), -term if sign == "-" else term, evaluate=False), wrap_line=False
        )
        parts.append(textwrap.indent(str(text).replace(f"{sign} =", f"  {sign}", 1), " " * 4))
    return "\n".join(parts)


def _width(text: str) -> int:
    return max(len(line) for line in text.splitlines())


def as_latex(title: str, steps: tuple[Step, ...]) -> str:
    """All steps as one LaTeX document, ready for `pdflatex`."""
    sections = [
        {
            "number": _escaped(step.number),
            "title": _escaped(step.title),
            "words": _escaped(step.words),
            "equations": [_latex(equation) for equation in step.equations],
        }
        for step in steps
    ]
    context = {"title": _escaped(title), "steps": sections}
    return render("derivation", "derivation.tex.jinja", context)


def as_html(title: str, steps: tuple[Step, ...]) -> str:
    """All steps as one page; browsers draw its MathML themselves."""
    sections = [
        {
            "number": step.number,
            "title": step.title,
            "words": step.words,
            "equations": [Markup(_mathml(equation)) for equation in step.equations],
        }
        for step in steps
    ]
    context = {"title": title, "steps": sections}
    return render("derivation", "derivation.html.jinja", context, html=True)


class _MathML(MathMLPresentationPrinter):  # type: ignore[misc]
    """SymPy's printer, with `thetaddot` as θ with two dots, as its other printers write it."""

    def _print_Symbol(self, symbol: Any, style: str = "plain") -> Any:
        base, underscore, rest = symbol.name.partition("_")
        for ending, dots in (("ddot", "¨"), ("dot", "˙")):
            letter = base.removesuffix(ending)
            if letter and letter != base:
                over = self.dom.createElement("mover")
                over.appendChild(self._print(sp.Symbol(letter)))
                accent = self.dom.createElement("mo")
                accent.appendChild(self.dom.createTextNode(dots))
                over.appendChild(accent)
                if not underscore:
                    return over
                whole = self.dom.createElement("msub")
                whole.appendChild(over)
                whole.appendChild(self._print(sp.Symbol(rest)))
                return whole
        return super()._print_Symbol(symbol, style)


def _mathml(equation: Equation) -> str:
    printer = _MathML()
    left, right = (printer._print(side).toxml() for side in (equation.left, equation.right))
    return f"<mrow>{left}<mo>=</mo>{right}</mrow>"


def _latex(equation: Equation) -> str:
    return f"{sp.latex(equation.left)} &= {sp.latex(equation.right)}"


_LATEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "ω": r"$\omega$", "α": r"$\alpha$",
}  # fmt: skip


def _escaped(text: str) -> str:
    """Text as it may stand in LaTeX; a character no plain document has becomes a question mark."""
    safe = (_LATEX.get(c, c if c.isascii() and c.isprintable() else "?") for c in text)
    return "".join(safe)
