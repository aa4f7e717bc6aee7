"""Runs that continue an earlier one."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from eomgen.base.errors import RunError
from eomgen.run.integrators import FixedStep, find_integrator
from eomgen.run.integrators.interface import Adaptive
from eomgen.run.origin import START, UNITS
from eomgen.run.problem import Problem
from eomgen.run.stepping import ANEW, can_go_on
from eomgen.run.trajectory import Trajectory

LISTED = 4
"""Number of differences that are named; of the others, only the number is given."""


class Asked(Protocol):
    """A method by name, and its step or tolerances."""

    @property
    def integrator(self) -> str: ...

    @property
    def dt(self) -> float | None: ...

    @property
    def rtol(self) -> float | None: ...

    @property
    def atol(self) -> float | None: ...


@dataclass(frozen=True, eq=False)
class Start:
    """The start of a run that continues another: the problem with its initial state, arguments of
    `integrate`, and a message.

    capped  whether the other run limited steps to a fraction of its length; None if this run is not
            exactly what that one would have become
    """

    problem: Problem
    options: Mapping[str, Any]
    words: str
    capped: bool | None = None

    def reported(self, run: Trajectory) -> str:
        """The message after the run."""
        capped = self.capped is not None and (self.capped or run.counts["capped"])
        if capped and np.isnan(run.resume.get("max_step", np.nan)):
            return f"{self.words}, except that the length of that run limits the steps"
        return self.words


def going_on(
    ended: Trajectory,
    path: Path,
    problem: Problem,
    asked: Asked,
    *,
    max_step: float | None = None,
    rest_speed: float | None = None,
) -> Start:
    """The start of a run that continues the run `ended`, read from `path`.

    With the same scene, parameters, inputs, method and step or tolerances it continues from the
    last whole step, to the same bytes as if that run had not ended. All methods with equal steps
    can do that, and without rigid contacts RK45 and DOP853. With other methods, or if something
    differs, the run starts anew from the last state, and the message says why.

    Raises `RunError` if the run is one of another scene, or if its file does not fit its method.
    """
    _check_scene(ended, path, problem)
    _check_kept(ended, path, problem)
    settings: dict[str, float | None] = {"dt": asked.dt}
    if asked.dt is None:
        settings = {"rtol": asked.rtol, "atol": asked.atol, "max_step": max_step}
    if problem.contacts:
        settings["rest_speed"] = rest_speed
    begin = float(ended.t[-1])
    why = _reasons(ended, problem, asked, settings)
    if why:
        words = f"starts anew from the state at t = {begin:g} s: {why}"
        return Start(replace(problem, initial=ended.y[-1]), {"t_start": begin}, words)
    begin = float(ended.resume["t"])
    words = f"continues from t = {begin:g} s as if the run had not ended"
    exactly = False
    if not _same_bits(ended, problem):
        words = (
            f"continues from t = {begin:g} s; the derivative there differs in its last bits from "
            "that run's, because of another --route, version or machine"
        )
    elif asked.dt is None and problem.contacts and ANEW not in ended.resume:
        words += ", within its tolerances: its end shortened a step in which contacts were located"
    else:
        exactly = True
    capped = bool(ended.counts["capped"]) if exactly else None
    return Start(problem, {"resume": ended.resume}, words, capped)


def _check_scene(ended: Trajectory, path: Path, problem: Problem) -> None:
    """Raise `RunError`, which names the differences, if a run is not of the problem's scene."""
    if ended.states != problem.states:
        raise RunError(
            f"--from: {path} has the states of '{ended.name}', {_few(ended.states)}, not those of "
            f"'{problem.name}', {_few(problem.states)}; give a run of this scene"
        )
    then, now = ended.origin, problem.origin
    if then is None or now is None:
        return
    different = [
        part
        for part in dict.fromkeys((*then.scene, *now.scene))
        if part != START and then.scene.get(part) != now.scene.get(part)
    ]
    if len(different) > 1 and UNITS in different:  # new parts bring new parameters
        different.remove(UNITS)
    for kind in ("parameters", "inputs"):
        mine, its = getattr(now, kind), getattr(then, kind)
        if not different and set(mine) != set(its):
            different.append(kind)
    if not different and [*then.scene] != [*now.scene]:
        different = ["order of bodies or effects"]
    if different:
        raise RunError(
            f"--from: {path} is a run of another '{ended.name}': it differs in "
            f"{_listed(different)}; give a run of this scene, or change values with --set"
        )


def _reasons(
    ended: Trajectory, problem: Problem, asked: Asked, settings: Mapping[str, float | None]
) -> str:
    """The reason why a problem cannot continue a run exactly; "" if it can."""
    then, now = ended.origin, problem.origin
    if ended.integrator != asked.integrator:
        return f"that run used {ended.integrator}"
    if not ended.resume:
        method = find_integrator(ended.integrator)
        history = f"{ended.integrator} depends on earlier steps, which are not in the file"
        return "that run was repaired by its guard" if can_go_on(method) else history
    if then is None or now is None:
        return "the scene of that run is not known"
    found = [
        f"--{name.replace('_', '-')} {_value(_kept(ended, name))}, not {_value(value)}"
        for name, value in settings.items()
        if _kept(ended, name) != value
    ]
    for mine, its in ((now.parameters, then.parameters), (now.inputs, then.inputs)):
        found += [
            f"{name} = {its[name]!r}, not {mine[name]!r}"
            for name in mine
            if np.float64(its[name]).tobytes() != np.float64(mine[name]).tobytes()
        ]
    measured = problem.contacts or (asked.dt is None and asked.atol is None)
    if measured and then.scene.get(START) != now.scene.get(START):
        found.append("another initial state, to which tolerances are relative")
    return f"that run had {_listed(found)}" if found else ""


def _kept(ended: Trajectory, name: str) -> float | None:
    """A setting of the run; None if it was not given."""
    value = float(ended.resume[name]) if name in ended.resume else np.nan
    return None if np.isnan(value) else value


def _same_bits(ended: Trajectory, problem: Problem) -> bool:
    """Whether the derivative at the start has the same bits as in that run, or is not known."""
    if np.isnan(ended.resume["derivative"]).any():
        return True
    try:
        now = problem.derivative(float(ended.resume["t"]), ended.resume["y"])
    except (ArithmeticError, ValueError):
        return False
    return bool(np.asarray(now).tobytes() == ended.resume["derivative"].tobytes())


def _check_kept(ended: Trajectory, path: Path, problem: Problem) -> None:
    """Raise `RunError` unless a run's file holds what its method needs to continue."""
    method = find_integrator(ended.integrator)
    if not ended.resume or not can_go_on(method):
        return
    needed = dict(_needed(ended, problem, method))
    fits = set(needed) == set(ended.resume) and all(
        shape is None or ended.resume[name].shape == shape for name, shape in needed.items()
    )
    if not (fits and _is_sane(ended.resume, problem)):
        raise RunError(
            f"{path}: its data for continuing do not fit {ended.integrator}; simulate again"
        )


def _needed(
    ended: Trajectory, problem: Problem, method: FixedStep | Adaptive
) -> Iterator[tuple[str, tuple[int, ...] | None]]:
    """The names and shapes of the arrays that are needed to continue; None for any shape."""
    ny = len(ended.states)
    yield from dict.fromkeys(("y", "derivative"), (ny,)).items()
    yield from dict.fromkeys(
        ("t", "grid", "dt", "rtol", "atol", "max_step", "rest_speed"), ()
    ).items()
    if not isinstance(method, FixedStep):
        yield from dict.fromkeys(("longest", "unseen"), ()).items()
    if ANEW in ended.resume:
        yield ANEW, ()
        return
    if isinstance(method, FixedStep):
        yield "lost", (ny,)
    else:
        for name in method.memory:
            yield name, (ny,) if name in method.vectors else ()
        if problem.switching:
            yield from (("until", ()), ("turned", ()), ("checked", None))
    if problem.contacts:
        yield from dict.fromkeys(("alpha", "fastest", "begun_t"), ()).items()
        yield from (("slack", (len(problem.contacts.names),)), ("begun_y", (ny,)), ("held", None))


def _is_sane(kept: Mapping[str, Any], problem: Problem) -> bool:
    """Whether the numbers are in the ranges that a run can leave."""
    optional = {"dt", "rtol", "atol", "max_step", "rest_speed"}
    may_be_infinite = {"longest", "until", "turned", "checked"}
    for name, value in kept.items():
        if name == "derivative":
            continue
        if name in optional:
            sane = np.isnan(value) or (np.isfinite(value) and value > 0)
        elif name in may_be_infinite:
            sane = not np.isnan(value).any()
        else:
            sane = np.isfinite(value).all()
        if not sane:
            return False
    lengths = [kept[name] for name in ("h_abs", "longest", "unseen") if name in kept]
    count = len(problem.contacts.names) if problem.contacts else 0
    held = kept.get("held", np.empty(0))
    return (
        all(length > 0 for length in lengths)
        and held.ndim == 1
        and bool(np.isin(held, np.arange(count)).all())
        and kept.get("checked", np.empty((0, 0))).ndim == 2
    )


def _value(value: float | None) -> str:
    return "at its default" if value is None else repr(value)


def _listed(names: list[str]) -> str:
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


def _few(states: tuple[str, ...]) -> str:
    return ", ".join(states[:3]) + (", …" if len(states) > 3 else "")
