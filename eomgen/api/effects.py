"""What each effect of a scene costs, and what leaving it out does: `effects`."""

from typing import TYPE_CHECKING

from eomgen.api.given import Source, check, check_time, read
from eomgen.api.reporter import SILENT, Reporter
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


def check_motion(motion: float | None, reporter: Reporter = SILENT) -> None:
    """Raise `RunError` for a time that is none."""
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
    """What `effects` returns of a scene; `name` is what it is called."""
    from eomgen.study.cost.bill import bill
    from eomgen.study.cost.variants import variants

    with reporter.located(), reporter.progress(f"costing {name or scene.name}") as progress:
        changed = variants(scene, each=each)
        return bill(scene, changed, motion=motion or 0.0, progress=progress)
