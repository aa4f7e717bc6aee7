"""The equations as SymPy matrices, with their derivation: `derive`."""

from dataclasses import replace

from eomgen.api.derivation import Derivation
from eomgen.api.given import Source, checked, modelled, read
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.model.model import Model
from eomgen.scene.schema import Form
from eomgen.tables.details import All, Detail, Method


@public
def derive(
    source: Source,
    *,
    form: Form | None = None,
    detail: Detail = "steps",
    method: Method | All | None = None,
) -> Derivation:
    """Derive M v̇ + V + G = F, and the steps to it, ending in the time derivative of a state.

    form  "velocity" for [q, v], "momentum" or "redundant" for the handout's states; by default the
          scene's. Trees of pins and free bodies in the plane have all three.
    detail  "summary": state, equations and solution; "steps": all that leads to them; "all": the
          forces in joints and constraints, too, and other ways to write the equations
    method  "newton-euler", "lagrange" or "kane", or "all" side by side; by default that which suits
          the mechanism

    Small mechanisms have their equations and solution as SymPy matrices. Larger ones are derived as
    the articulated-body algorithm with their own bodies and joints. Raises `SceneError` for a form
    or a method that the mechanism does not have.
    """
    return derivation_of(modelled(read(source)), form=form, detail=detail, method=method)


def derivation_of(
    model: Model,
    reporter: Reporter = SILENT,
    *,
    form: Form | None = None,
    detail: Detail = "steps",
    method: Method | All | None = None,
) -> Derivation:
    """The derivation of a model. Raises `SceneError` as `derive` does."""
    from eomgen.derivation.exposition import exposition_of  # imports SymPy
    from eomgen.derivation.reading import at_detail
    from eomgen.derivation.ways import compared

    with reporter.located(), reporter.waiting(f"deriving {model.name} …"):
        checked(model)
        found = compared(model, form) if method == "all" else exposition_of(model, form, method)
        return Derivation(model, replace(found, steps=at_detail(found.steps, detail)))
