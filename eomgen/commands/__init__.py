"""The commands, one function each. A command imports slow packages itself, when it runs."""

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
    """The version of eomgen."""
    return importlib.metadata.version("eomgen")
