"""What accuracy costs in time: `accuracy`."""

from eomgen.commands.arithmetic import print_arithmetic
from eomgen.commands.shared import Arguments, read_model


def accuracy(given: Arguments) -> int:
    """Print how exact the arithmetic is."""
    model, name = read_model(given.scene, given)
    print_arithmetic(given, model, name)
    return 0
