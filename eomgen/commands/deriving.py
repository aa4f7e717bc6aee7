"""The derivation on the terminal: `derive`."""

import sys

from eomgen.commands.shared import Arguments, located, read_model
from eomgen.dynamics.singularity import check_nonsingular
from eomgen.files import check_writable, write_whole
from eomgen.run.progress import terminal_notice


def derive(given: Arguments) -> int:
    """The derivation as text, LaTeX or a page."""
    model, _ = read_model(given.scene, given)
    if given.output is not None:
        check_writable(given.output, force=given.force)
    from eomgen.derivation.matrices import matrices
    from eomgen.show.derivation import as_html, as_latex, as_text

    with located(given.scene), terminal_notice(f"deriving {model.name} …"):
        check_nonsingular(model)
        steps = matrices(model).steps
    if given.format == "text":
        encoding = "utf-8" if given.output else sys.stdout.encoding
        text = as_text(model.name, model.title, steps, encoding=encoding)
    else:
        write = {"latex": as_latex, "html": as_html}[given.format]
        text = write(model.name, model.title, steps)
    if given.output is None:
        print(text)
    else:
        write_whole(given.output, text, force=given.force)
        print(f"wrote {given.output}")
    return 0
