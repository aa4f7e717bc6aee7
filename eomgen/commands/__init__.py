"""What each command does; what is heavy is imported by the command that needs it."""

import importlib.metadata

from eomgen.commands.accuracy import accuracy
from eomgen.commands.costing import effects
from eomgen.commands.deriving import derive
from eomgen.commands.describing import check, list_scenes, print_reference, print_schema
from eomgen.commands.generating import generate
from eomgen.commands.linearising import linearise
from eomgen.commands.running import simulate, view
from eomgen.commands.verifying import verify

__all__ = [
    "accuracy",
    "check",
    "derive",
    "effects",
    "generate",
    "linearise",
    "list_scenes",
    "print_reference",
    "print_schema",
    "simulate",
    "verify",
    "version",
    "view",
]


def version() -> str:
    """This program's version."""
    return importlib.metadata.version("eomgen")
