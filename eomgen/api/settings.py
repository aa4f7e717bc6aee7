"""The settings of a run: its method, and tolerances or a step."""

from typing import TYPE_CHECKING

from eomgen.api.reporter import SILENT, Reporter
from eomgen.base.errors import RunError
from eomgen.scene.schema import Simulation

if TYPE_CHECKING:
    from eomgen.study.accuracy.trial import Setting


def setting_of(
    simulation: Simulation,
    integrator: str | None = None,
    *,
    dt: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    reporter: Reporter = SILENT,
) -> "Setting":
    """The method with its tolerances or step; None stands for those of the scene, `simulation`.

    Raises `RunError` for tolerances of a fixed-step method.
    """
    from eomgen.run.integrators import FixedStep, find_integrator
    from eomgen.study.accuracy.trial import Setting

    name = simulation.integrator if integrator is None else integrator
    if not isinstance(find_integrator(name), FixedStep):
        return Setting(
            name,
            simulation.rtol if rtol is None else rtol,
            simulation.atol if atol is None else atol,
            dt,
        )
    if rtol is not None or atol is not None:
        rtol_name, atol_name, dt_name = map(reporter.argument, ("rtol", "atol", "dt"))
        raise RunError(
            f"{rtol_name}, {atol_name}: {name} takes equal steps; give {dt_name} instead"
        )
    return Setting(name, dt=simulation.dt if dt is None else dt)


def check_unstable(setting: "Setting | None", reporter: Reporter) -> None:
    """Raise `RunError` for `unstable` unless the method is explicit with a given step."""
    from eomgen.run.integrators import FixedStep, find_integrator

    asked = reporter.argument("unstable")
    if setting is None:
        raise RunError(
            f"{asked}: is for a given step; leave out "
            f"{reporter.argument('accuracy')} and {reporter.argument('budget')}"
        )
    method = find_integrator(setting.integrator)
    if not (isinstance(method, FixedStep) and method.explicit):
        raise RunError(
            f"{asked}: {setting.integrator} is stable at any step or chooses its own; leave "
            f"it out, or take {reporter.argument('integrator')} euler, leapfrog or rk4"
        )
