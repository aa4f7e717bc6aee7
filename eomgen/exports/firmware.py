"""C99 for firmware: a header and a source without allocation or global state."""

from eomgen.codegen.backends import c
from eomgen.exports import Options, Written
from eomgen.model.model import Model
from eomgen.store import interfaced_program_of


def files(model: Model, options: Options) -> Written:
    """The source and its header."""
    return Written(c.files(*interfaced_program_of(model)))
