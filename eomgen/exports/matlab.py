"""Functions for MATLAB and Octave: the files of the backend, in a folder of their own."""

from eomgen.codegen.backends import matlab
from eomgen.exports import Options, Written
from eomgen.model.model import Model
from eomgen.store import interfaced_program_of


def files(model: Model, options: Options) -> Written:
    """A function for the derivative and one for each output. Raises `RunError` as the backend."""
    return Written(matlab.files(*interfaced_program_of(model)))
