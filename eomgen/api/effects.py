"""The cost of each effect of a scene, and the change of its motion without it: `effects`."""

from typing import TYPE_CHECKING

from eomgen.api.given import model_of, read
from eomgen.api.inputs import all_in_formulas
from eomgen.api.options import EffectsOptions
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.base.options import taking
from eomgen.scene.schema import Scene

if TYPE_CHECKING:
    from eomgen.study.cost.bill import Bill


@public
@taking(EffectsOptions)
def effects(options: EffectsOptions) -> "Bill":
    """Measure what each effect adds to the operations and the time of a derivative, and how the
    motion changes without it.

    Raises `SceneError`, or `RunError` unless `motion` is positive.
    """
    scene = all_in_formulas(read(options.source), options.inputs)
    model_of(scene, options.source)
    return bill_of(scene.replaced(route=options.route or scene.route), options)


def bill_of(
    scene: Scene,
    options: EffectsOptions,
    *,
    name: str = "",
    reporter: Reporter = SILENT,
) -> "Bill":
    """The result of `effects` for a scene; `name` is the name of the scene in messages."""
    from eomgen.study.cost.bill import bill
    from eomgen.study.cost.variants import variants

    with reporter.located(), reporter.progress(f"costing {name or scene.name}") as progress:
        changed = variants(scene, each=options.each)
        return bill(scene, changed, motion=options.motion or 0.0, progress=progress)
