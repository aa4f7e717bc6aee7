"""The equations as SymPy matrices, with their derivation: `derive`."""

from eomgen.api.given import Source, checked, modelled, read
from eomgen.api.reporter import SILENT, Reporter
from eomgen.model.model import Model
from eomgen.results import Derivation


def derive(source: Source) -> Derivation:
    """Derive M v̇ + V + G = F as SymPy matrices, its solution for v̇, and the steps to it.

    Raises `SceneError` if the mechanism is too large to be read, or has no closed form.
    """
    return derivation_of(modelled(read(source)))


def derivation_of(model: Model, reporter: Reporter = SILENT) -> Derivation:
    """The derivation of a model. Raises `SceneError` as `derive` does."""
    from eomgen.derivation.matrices import matrices  # imports SymPy

    with reporter.located(), reporter.waiting(f"deriving {model.name} …"):
        checked(model)
        return Derivation(model.name, model.title, matrices(model))
