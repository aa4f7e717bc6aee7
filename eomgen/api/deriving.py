"""The equations as people read them: `derive`."""

from eomgen.api.given import Source, check
from eomgen.results import Derivation


def derive(source: Source) -> Derivation:
    """M v̇ + V + G = F as SymPy matrices, its solution, and all steps that lead there.

    Raises `SceneError` for a mechanism too large to be read, or one that a closed form is not for.
    """
    from eomgen.derivation.matrices import matrices  # brings SymPy

    model = check(source)
    return Derivation(model.name, model.title, matrices(model))
