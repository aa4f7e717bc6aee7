"""The functions of a module that runs by a method call, beside those that are called rarely."""

from typing import Any

from eomgen.run.integrators.interface import Adaptive, FixedStep
from eomgen.run.integrators.strides import OF_CONTACTS, OF_STATE
from eomgen.run.projection import PROJECTS


def needed_by(method: FixedStep | Adaptive, module: Any) -> tuple[str, ...]:
    """The names of the functions of a module that runs by a method call at each step or event."""
    names = ["derivative"]
    if isinstance(method, Adaptive):
        names += [*(["jacobian"] if method.uses_jacobian else []), *OF_STATE]
    elif not method.explicit:
        names.append("jacobian")
    if getattr(module, "CONTACTS", ()):
        names += OF_CONTACTS
    if getattr(module, "CONSTRAINTS", ()):
        names += PROJECTS
    return tuple(name for name in names if hasattr(module, name))
