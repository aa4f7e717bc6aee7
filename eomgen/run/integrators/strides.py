"""Steps of an adaptive method, many at once, in compiled code or in Python."""

from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

import numpy as np

from eomgen.run.branches import BranchMonitor
from eomgen.run.compiled import Array, Steps, Stretch, Stride, Watched
from eomgen.run.integrators.in_python import AHEAD, InPython
from eomgen.run.integrators.interface import Resume
from eomgen.run.integrators.portions import Portion, Size
from eomgen.run.integrators.stepper import Stepper, continuation
from eomgen.run.problem import Problem
from eomgen.run.projection import PROJECTS, constrained_by
from eomgen.run.rows import Rows

OF_STATE, OF_CONTACTS = ("switching_functions",), ("gaps", "gap_rates", "held", "impact")
"""Functions of a module that steps are checked with."""


class Strides:
    """Makes the steps of a run, in compiled code if there is some."""

    def __init__(self, stepper: Stepper) -> None:
        problem, settings = stepper.problem, stepper.settings
        switching, contacts, self._looked = (
            problem.switching,
            problem.contacts,
            problem.solved_loops,
        )
        self._stepper, self._steps = stepper, settings.steps if stepper.method.compiled else None
        self._dense = settings.dense or self._looked is not None
        self._atol = np.zeros(problem.initial.shape) + stepper.bounds.atol
        self._needed = (
            *(OF_STATE if switching and switching.of_state else ()),
            *(OF_CONTACTS if contacts else ()),
            *(PROJECTS if problem.projection else ()),
        )
        self._usual, self._size = True, Size()
        looks = contacts, problem.projection, self._looked, stepper.branches
        self._alone = settings.alone or any(map(bool, looks))
        self._ahead = 1

    @cached_property
    def _own(self) -> InPython:
        """Makes steps in Python."""
        return InPython(self._stepper)

    def made(self, most: int) -> Portion | None:
        """Make at most `most` steps and put the solver at their end; None if the next one must be
        made again.
        """
        name = self._stepper.method.compiled
        steps = self._steps(name, self._needed) if self._steps else None
        portion = self._compiled(steps, most) if steps else None
        return portion or self._in_python(1 if steps or self._alone else min(most, self._ahead))

    def _in_python(self, most: int) -> Portion | None:
        """The same in Python. An event may end the steps, and those beyond it are in vain."""
        branches, stride = self._stepper.branches, self._own.made(most)
        if stride is None:
            return None
        self._ahead = min(2 * self._ahead, AHEAD)
        memory = branches.memory if branches else {}
        return self._portion(stride, None, lambda _: memory)

    def _compiled(self, steps: Steps, most: int) -> Portion | None:
        """The same in compiled code; None if Python must make the next one."""
        stepper, solver, branches = self._stepper, self._stepper.solver, self._stepper.branches
        usual, self._usual = self._usual, True
        features = branches and branches.features
        if not usual or (features and not hasattr(solver, "f")):
            return None
        most, watched = min(most, self._size.most), None
        if branches:
            watched = branches.watched(solver.t, solver.h_abs, most, stepper.until)
            if not watched:
                return None
        bounds, looked = stepper.bounds, self._looked is not None
        # Where steps are looked at within, Python counts what that takes only if it is done.
        until = stepper.until, not looked
        along = solver, *until, bounds.rtol, self._atol, stepper.longest, most, self._dense
        counts_terms = stepper.settings.dense
        held = constrained_by(stepper.problem.projection)
        times = stepper.times[stepper.sampled :]
        met = stepper.touched
        touched = met and met.copy(solver.t, solver.y, most)
        stride = steps(Stretch(*along, counts_terms, times, watched, touched, bool(features), held))
        if not len(stride.ends):
            return None
        if branches and features and not self._size.fits(_are_tame(branches, solver, stride)):
            return None
        margins = stride.margins
        if self._looked:
            margins = self._looked.passed(solver.t, solver.y, stride.ends, stride.states)
            if not self._size.fits(margins is not None):
                return None
        self._usual = stride.usual
        if met and touched:
            met.now.slack[:] = touched.slack
        if branches and watched:
            if watched.ends:
                branches.passed(stride.ends, stride.values, stride.switched)
            branches.restore(_checks(watched, stride, len(stride.ends) - 1))
        checked = partial(_checks, watched, stride) if watched else _unchecked
        portion = self._portion(stride, margins, checked)
        if stride.event and met and touched:
            return portion._replace(met=partial(met.take, touched))
        return portion

    def _portion(
        self, stride: Stride, margins: Array | None, checked: Callable[[int], dict[str, Any]]
    ) -> Portion:
        """These steps, at whose end the solver is put; `checked` gives what `BranchMonitor.memory`
        is after one of them.
        """
        stepper, solver = self._stepper, self._stepper.solver
        ends, until, is_whole = stride.ends, stepper.until, stepper.is_whole
        start, whole = solver.t, len(ends)
        if is_whole and until == stepper.t_end and stepper.method.series:  # tries no step twice
            whole -= int(ends[-1] == until)
        elif is_whole and until == stepper.t_end:
            starts = np.concatenate(([start], ends[:-1]))
            lengths = np.concatenate(([solver.h_abs], stride.memory["h_abs"][:-1]))
            free = starts + np.minimum(lengths, stepper.longest) < until
            whole = whole if free.all() else int(np.argmin(free))
        if whole < len(ends):  # those from there on are shortened by the end
            stepper.shorten(until)
        solver.t_old, solver.t = float(ends[-2]) if len(ends) > 1 else start, float(ends[-1])
        for name, values in stride.memory.items():
            last = values[-1]
            setattr(solver, name, last.copy() if last.ndim else float(last))
        solver.reached = not ends[-1] < until
        within = partial(_within, stepper.problem, stride.within) if stride.within else _unknown
        cut = until if until != stepper.t_end else np.inf
        resume = partial(_after, stride, checked, cut, whole - 1) if is_whole and whole else None
        rows = Rows(stepper.times[stepper.sampled :][: stride.sampled[-1]], stride.rows)
        before, factorisations = stepper.counted()
        counts = {**stride.counts, "capped": stepper.capped(start, ends)}
        counts["cut"] = [before] * len(ends) if before else None
        if factorisations:
            counts["factorisations"] = factorisations + stride.counts["factorisations"]
        stepper.sampled += int(stride.sampled[-1])
        of = ends, stride.states, rows, stride.sampled, counts
        met = _nothing if stride.event else None
        return Portion(stepper.problem, start, *of, within, resume, margins, met)


def _are_tame(branches: BranchMonitor, solver: Any, stride: Stride) -> bool:
    """Whether steps pass over nothing but branches."""
    t = np.concatenate(([solver.t], stride.ends))
    y = np.concatenate((solver.y[None], stride.states))
    return branches.tame(t, y, np.concatenate((solver.f[None], stride.memory["f"])))


def _nothing() -> None:
    """What is to be known of an event in a step of Python is known."""


def _unchecked(i: int) -> dict[str, Any]:
    """There are no branches."""
    return {}


def _after(
    stride: Stride, checked: Callable[[int], dict[str, Any]], cut: float, last: int, i: int
) -> Resume:
    """What a later run needs to continue after step i, or after the `last`, if the steps up to
    there do not depend on the end of the run. Steps that are cut off end at `cut`.
    """
    i = min(i, last)
    memory: dict[str, Any] = {name: values[i] for name, values in stride.memory.items()}
    end = float(stride.ends[i])
    checks = checked(i)
    if checks:
        memory |= {"until": cut if end < cut else np.inf, **checks}
    return continuation(end, stride.states[i], memory)


def _checks(watched: Watched, stride: Stride, i: int) -> dict[str, Any]:
    """What `BranchMonitor.memory` is after step i."""
    if not watched.ends:
        return {"turned": watched.switched, "checked": np.empty((0, 0))}
    before = (stride.ends[i - 1], stride.values[i - 1]) if i else watched.ends[-1]
    pairs = before, (stride.ends[i], stride.values[i])
    checked = np.array([[t, *values] for t, values in pairs])
    return {"turned": stride.switched[i], "checked": checked}


def _within(problem: Problem, states: Callable[[int, float], Array], i: int, t: float) -> Array:
    """The state at a time in step i."""
    return problem.projected(t, states(i, t))


def _unknown(i: int, t: float) -> Array:
    raise AssertionError("states within these compiled steps were not asked for")
