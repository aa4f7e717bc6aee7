"""The cost of each effect of a scene, and the change of its motion without it: `effects`."""

from typing import TYPE_CHECKING

from eomgen.api.given import Source, check_time, model_of, read
from eomgen.api.inputs import Inputs, all_in_formulas
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.scene.schema import Route, Scene

if TYPE_CHECKING:
    from eomgen.study.cost.bill import Bill

MOTION = 10.0
"""Default length of the motions that are compared, s."""


@public
def effects(
    source: Source,
    *,
    route: Route | None = None,
    each: bool = False,
    motion: float | None = MOTION,
    inputs: Inputs | None = None,
) -> "Bill":
    """Measure what each effect adds to the operations and the time of a derivative, and how the
    motion changes without it.

    route   to the equations; None: the scene's own
    each    each effect separately, not all of a type together
    motion  length of the motions that are compared, s; None: motions are not compared
    inputs  constants, formulas or a table in place of inputs, as for `simulate`; others are 0

    Raises `SceneError`, or `RunError` unless `motion` is positive.
    """
    check_motion(motion)
    scene = all_in_formulas(read(source), inputs)
    model_of(scene, source)
    return bill_of(scene.replaced(route=route or scene.route), each=each, motion=motion)


def check_motion(motion: float | None, reporter: Reporter = SILENT) -> None:
    """Raise `RunError` unless the length of the motions, s, is positive."""
    if motion is not None:
        check_time(motion, reporter.argument("motion"))


def bill_of(
    scene: Scene,
    *,
    each: bool = False,
    motion: float | None = MOTION,
    name: str = "",
    reporter: Reporter = SILENT,
) -> "Bill":
    """The result of `effects` for a scene; `name` is the name of the scene in messages."""
    from eomgen.study.cost.bill import bill
    from eomgen.study.cost.variants import variants

    with reporter.located(), reporter.progress(f"costing {name or scene.name}") as progress:
        changed = variants(scene, each=each)
        return bill(scene, changed, motion=motion or 0.0, progress=progress)
