"""The options of `integrate`."""

from dataclasses import KW_ONLY, dataclass, field

from eomgen.base.options import about, option
from eomgen.run.guard import Guard
from eomgen.run.integrators.interface import Resume
from eomgen.run.problem import Problem
from eomgen.run.progress import Progress
from eomgen.run.tally import Tally
from eomgen.run.works import Powers


@dataclass(frozen=True)
class Wanted:
    """The arguments of `integrate`."""

    problem: Problem = field(metadata=about("what is integrated"))
    integrator: str = field(metadata=about("a name in `eomgen.tables.integrators.INTEGRATORS`"))
    t_end: float = field(metadata=about("end time", "s"))
    _: KW_ONLY
    t_start: float = option(0.0, "time at the start", "s")
    dt: float | None = option(
        None, "step of the fixed-step methods, s, which need it; the last one is shortened"
    )
    rtol: float = option(
        1e-9, "relative tolerance for the error of each step of the adaptive methods"
    )
    atol: float | None = option(
        None,
        "absolute tolerance of these",
        none="1e-12 of each state's size in `problem.sizes`, less if rtol is below 1e-9",
    )
    samples: int | None = option(
        None,
        "number of rows to keep: for fixed steps every k-th one such that there are about this "
        "many, for adaptive methods this many equally spaced times; the first and the last are "
        "always kept",
        none="all, or 1001",
    )
    progress: Progress | None = option(
        None, "called with the fraction done, at most about ten times a second"
    )
    max_step: float | None = option(
        None,
        "longest step in s of the adaptive methods; by default only the error bounds it. If the "
        "derivative has corners, a step that has passed over a contact or a pulse is repeated "
        "(`run.branches`); if that cannot be detected, steps are at most 1/1000 of the run",
    )
    max_steps: int = option(10_000_000, "most steps of a run")
    rest_speed: float | None = option(
        None,
        "contacts that close more slowly than this, in m/s or rad/s, do not bounce; those that "
        "then neither open nor close are held, so that bouncing comes to an end. By default it is "
        "√(1e-7 a size), with a the acceleration of the gaps without contact forces: slower "
        "contacts would rise by less than 5e-8 of the mechanism's size",
    )
    powers: Powers | None = option(None, "given to compute the works of effects")
    resume: Resume | None = option(
        None,
        "`Trajectory.resume` of an earlier run, from which this one continues; `t_start` and "
        "`problem.initial` are ignored. The result has the same bytes as if that run had not "
        "ended, if problem, method and step or tolerances are the same",
    )
    guard: Guard | None = option(
        None,
        "checks the rounding errors of the derivative at every step, and stops the run where "
        "digits are lost, or repairs it (`run.guard`); it does not change other steps",
    )
    unstable: bool = option(
        False,
        "whether an explicit method with equal steps may run with steps too long for stability; "
        "else the run stops there and says how long they may be",
    )
    tally: Tally | None = option(None, "updated at every step; may end the run")
