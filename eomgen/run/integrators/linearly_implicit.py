"""Semi-implicit Euler that is implicit in stiff forces: see `eomgen.dynamics.resisting`.

The module makes the steps itself, by its output `implicit_step`. They are stable for contacts,
friction, stops, springs, dampers and gains of any stiffness, and of order 1.
"""

from eomgen.base.errors import RunError
from eomgen.engine.explicit import Step
from eomgen.engine.linearly_implicit import linearly_implicit
from eomgen.run.integrators.interface import Change, FixedStep
from eomgen.run.problem import FloatArray, Problem


def prepare(problem: Problem) -> Change:
    """Its steps. Raises `RunError` for rigid contacts, and for a module without the output."""
    if problem.contacts is not None:
        raise RunError(rigid(problem.contacts.names[0]))
    if problem.implicit_step is None:
        raise RunError(
            "integrator: linearly_implicit needs the output 'implicit_step', which the module "
            "lacks; generate it with that output"
        )
    step = Step()

    def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
        linearly_implicit(problem, t, y, h, step)  # type: ignore[arg-type]
        return step.change

    return change


def rigid(contact: str) -> str:
    """What is said of a rigid contact, which these steps do not take."""
    return (
        f"integrator: linearly_implicit takes soft contacts, and '{contact}' is rigid; give it law "
        "= 'spring_damper' or, a stop, a stiffness, or take semi_implicit_euler"
    )


INTEGRATOR = FixedStep(
    prepare,
    order=1,
    remedy="take a smaller --dt, or an adaptive method (--integrator Radau)",
    explicit=False,
    compiled="linearly_implicit",
)
