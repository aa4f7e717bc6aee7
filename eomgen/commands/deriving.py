"""The command `derive`."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from eomgen.api.deriving import derivation_of
from eomgen.base.errors import RunError
from eomgen.base.files import check_writable, write_whole
from eomgen.commands.shared import Arguments, read_model, reporter_of

if TYPE_CHECKING:
    from eomgen.derivation.exercise import Exercise


def derive(given: Arguments) -> int:
    """Print or write the derivation as text, LaTeX or HTML."""
    kind = given.format or _kind(given.output)
    if (given.solutions or given.seed) and not given.exercise:
        name = "--solutions" if given.solutions else "--seed"
        raise RunError(f"{name}: is for an exercise; give --exercise too")
    model, _ = read_model(given.scene, given)
    if given.output is not None:
        check_writable(given.output, force=given.force)
    reporter = reporter_of(given, given.scene)
    found = derivation_of(
        model, reporter, form=given.state_form, detail=given.detail, method=given.method
    )
    if given.exercise:
        text = _exercise(found.exercise(given.seed), kind, solved=given.solutions)
    elif kind == "text":
        text = found.text(encoding="utf-8" if given.output else sys.stdout.encoding)
    else:
        text = found.latex() if kind == "latex" else found.html()
    if given.output is None:
        print(text)
    else:
        write_whole(given.output, text, force=given.force)
        print(f"wrote {given.output}")
    return 0


def _exercise(exercise: "Exercise", kind: str, *, solved: bool) -> str:
    """A sheet with blanks or answers; the page with blanks checks what is typed."""
    from eomgen.show.derivation import as_html, as_latex, as_text
    from eomgen.show.exercise import as_page

    model, steps = exercise.model, exercise.steps(solved=solved)
    if kind == "text":
        return as_text(model, steps, exercise.exposition.effects)
    if kind == "latex":
        return as_latex(model, steps, exercise.exposition.effects)
    return as_html(model, steps, exercise.exposition.effects) if solved else as_page(exercise)


def _kind(output: Path | None) -> str:
    """What is written to a file, by its ending. Raises `RunError` for a PDF."""
    if output is None:
        return "text"
    if output.suffix == ".pdf":
        tex = output.with_suffix(".tex")
        raise RunError(f"-o {output}: write {tex}, of which pdflatex makes a PDF")
    return {".html": "html", ".tex": "latex"}.get(output.suffix, "text")
