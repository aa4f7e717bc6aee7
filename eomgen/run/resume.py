"""Runs that go on where an earlier one ended."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from eomgen.errors import RunError
from eomgen.run.problem import Problem
from eomgen.run.trajectory import Trajectory


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
    """Where a run begins: the problem with its initial state, what `integrate` is told, and what
    there is to say of it.
    """

    problem: Problem
    options: Mapping[str, Any]
    words: str


def going_on(ended: Trajectory, path: Path, problem: Problem, asked: Asked) -> Start:
    """How a problem goes on where a run ended that was read from `path`.

    With the same method and step or tolerances it goes on from the last whole step, to the same
    bytes as if that run had not ended: all methods of equal steps do, and without rigid contacts
    RK45, DOP853 and gragg_bulirsch_stoer. The others, and those with another step, begin anew at
    the last state.
    Raises `RunError` if the states are not those of the problem.
    """
    if ended.states != problem.states:
        raise RunError(
            f"--from: {path} has the states of '{ended.name}', {_few(ended.states)}, not those of "
            f"'{problem.name}', {_few(problem.states)}; give a run of this scene"
        )
    begin = float(ended.t[-1])
    same = ("rtol", "atol") if asked.dt is None else ("dt",)
    if not ended.resume:
        why = f"{ended.integrator} keeps a history of its own"
    elif ended.integrator != asked.integrator:
        why = f"that run was by {ended.integrator}"
    elif any(_differ(ended, name, getattr(asked, name)) for name in same):
        why = "that run had another step, or other tolerances"
    else:
        begin = float(ended.resume["t"])
        words = f"goes on from t = {begin:g} s as if the run had not ended"
        if asked.dt is None and problem.contacts:
            words += (
                ", within its tolerances: the last contacts were found in a step that the end cut"
            )
        return Start(problem, {"resume": ended.resume}, words)
    words = f"begins anew from the state at t = {begin:g} s: {why}"
    return Start(replace(problem, initial=ended.y[-1]), {"t_start": begin}, words)


def _differ(ended: Trajectory, name: str, value: float | None) -> bool:
    """Whether the run had another value; none is kept as nan."""
    kept = float(ended.resume[name]) if name in ended.resume else np.nan
    return not (np.isnan(kept) if value is None else kept == value)


def _few(states: tuple[str, ...]) -> str:
    return ", ".join(states[:3]) + (", …" if len(states) > 3 else "")
