"""What each effect of a scene costs, and what leaving it out does: `effects`."""

import math
from typing import TYPE_CHECKING

from eomgen.api.given import Source, check, read
from eomgen.api.manner import SILENT, Manner
from eomgen.errors import RunError
from eomgen.scene.schema import Route, Scene

if TYPE_CHECKING:
    from eomgen.study.cost.bill import Bill

MOTION = 10.0
"""Time that motions are compared for, s."""


def effects(
    source: Source,
    *,
    route: Route | None = None,
    each: bool = False,
    motion: float | None = MOTION,
) -> "Bill":
    """What each effect adds to the operations and the time of a derivative, and what leaving it
    out does to the motion.

    route   to the equations; None: the scene's own
    each    each effect for itself, not all of a type together
    motion  time that motions are compared for, s; None: they are not

    Raises `SceneError` for a scene that makes no mechanism, `RunError` for a time that is none.
    """
    check_motion(motion)
    scene = read(source)
    check(scene)
    return bill_of(scene.replaced(route=route or scene.route), each=each, motion=motion)


def check_motion(motion: float | None, manner: Manner = SILENT) -> None:
    """Raise `RunError` for a time that is none."""
    if motion is not None and not 0 < motion < math.inf:
        raise RunError(f"{manner.option('motion')}: {motion:g} is no positive time; give one in s")


def bill_of(
    scene: Scene,
    *,
    each: bool = False,
    motion: float | None = MOTION,
    name: str = "",
    manner: Manner = SILENT,
) -> "Bill":
    """What `effects` returns of a scene; `name` is what it is called."""
    from eomgen.study.cost.bill import bill
    from eomgen.study.cost.variants import variants

    with manner.located(), manner.watch(f"costing {name or scene.name}") as progress:
        changed = variants(scene, each=each)
        return bill(scene, changed, motion=motion or 0.0, progress=progress)
