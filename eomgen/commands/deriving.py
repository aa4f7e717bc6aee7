"""The derivation told: `derive`."""

import sys
from typing import TYPE_CHECKING

from eomgen.commands.shared import Arguments, located, read_model
from eomgen.derivation.recursive.regular import check_regular
from eomgen.derivation.supported import MOST_TOLD, why_not_pins
from eomgen.errors import SceneError
from eomgen.files import check_writable, write_whole
from eomgen.model import Model
from eomgen.run.progress import terminal_notice

if TYPE_CHECKING:
    from eomgen.derivation.steps import Step


def derive(given: Arguments) -> int:
    """The derivation as text, LaTeX or a page."""
    model, _ = read_model(given.scene, given)
    if given.output is not None:
        check_writable(given.output, force=given.force)
    from eomgen.show.derivation import as_html, as_latex, as_text

    with located(given.scene), terminal_notice(f"deriving {model.name} …"):
        steps = _steps(model)
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


def _steps(model: Model) -> "tuple[Step, ...]":
    """The handout's derivation where it is for the model, and the general one elsewhere."""
    check_regular(model)
    if len(model.bodies) > MOST_TOLD:
        raise SceneError(
            f"derive: tells mechanisms of up to {MOST_TOLD} bodies, and this has "
            f"{len(model.bodies)}; generate writes the module of any"
        )
    if why_not_pins(model):
        from eomgen.derivation.general.derive import derive_general
        from eomgen.derivation.general.tell import tell_general

        return tell_general(derive_general(model))
    from eomgen.derivation.closed import derive as derive_equations
    from eomgen.derivation.steps import tell

    return tell(derive_equations(model))
