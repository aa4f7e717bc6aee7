"""The reference that runs are compared with: the motion to more digits, with an error bound.

Gauss collocation in extended precision (`collocation`) computes the motion twice, once with fewer
stages and a looser tolerance. The tighter result is kept. The stated error is the difference of the
two plus rounding to doubles. With rigid contacts, or if collocation would take too long, two
methods in doubles at their tightest tolerance are used instead; the stated error is twice their
difference, and the origin says so.
"""

import hashlib
import io
import time
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from eomgen.base.entries import Entries
from eomgen.base.errors import RunError
from eomgen.base.files import write_whole
from eomgen.base.options import taking
from eomgen.program.program import Program
from eomgen.run.integrate import integrate
from eomgen.run.integrators.interface import SMALLEST_RTOL
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.progress import Progress, throttled
from eomgen.run.tally import Tally
from eomgen.store import program_of
from eomgen.study.accuracy import measure
from eomgen.study.accuracy.collocation import Row, rows
from eomgen.study.accuracy.gauss import ExtendedArray
from eomgen.study.accuracy.options import ReferenceOptions
from eomgen.study.diagnosis import problem_of
from eomgen.study.precision.precise import BITS, digits, precise

ROWS = 201
TIGHT, LOOSE = ((6, 8, 10, 12), 1e-22), ((5, 7, 9, 11), 1e-20)
"""Numbers of stages, and the tolerance of a step relative to the scale: of the result that is kept,
and of the other."""
FORMAT = "reference 5"
"""Must change whenever references would come out differently."""
_SOON = 1.0
"""Processor time that a run in doubles may always take, s."""
_LOOKS = 64
"""Derivatives between two checks of the time in a run in doubles."""
SELDOM = 50
"""Steps between two checks of the time in extended precision."""
_JUDGED = 0.1
"""Part of the time allowed after which a run's speed is judged."""


@dataclass(frozen=True, eq=False)
class Reference:
    """A reference motion.

    t            times (n,), s, equally spaced, both ends included
    y            states (n, ny), rounded to doubles
    scale        of each state (ny,): `measure.scales`
    error        bound of the error of y over all rows, relative to the scale
    final_error  the same for the last row
    origin       method, digits, and how the error was found, in one line
    seconds      how long it took
    """

    t: FloatArray
    y: FloatArray
    scale: FloatArray
    error: float
    final_error: float
    origin: str
    seconds: float


_Found = tuple[FloatArray, FloatArray, FloatArray, str]
"""The motion (n, ny), the motion plus its error (n, ny), the least and greatest states (2, ny), and
the origin."""


class TooLongError(Exception):
    """The computation would take longer than allowed."""


def paced(problem: Problem, t_end: float, seconds: float, progress: Progress) -> Problem:
    """The same problem with a time limit. A run up to `t_end`, s, reports its progress and ends
    when it clearly takes more than `seconds` of processor time, and more than one second. The
    derivative then raises `TooLongError`: a failing step may be repeated without end.
    """
    began, calls, report = time.process_time(), 0, throttled(progress)
    allowed = max(seconds, _SOON)

    def derivative(t: float, y: FloatArray) -> FloatArray:
        nonlocal calls
        calls += 1
        if not calls % _LOOKS:
            done = min(max(float(t) / t_end, 0.0), 1.0)
            report(done)
            _check_pace(time.process_time() - began, done, allowed, "doubles")
        return problem.derivative(t, y)

    return replace(problem, derivative=derivative)


@taking(ReferenceOptions)
def reference(wanted: ReferenceOptions) -> Reference:
    """The motion of a module from 0 to `t_end`, s, at given parameters and constant inputs.

    Raises `RunError` if the module refuses parameters or inputs, if the motion does not reach
    `t_end`, or if doubles would be needed but are not allowed.
    """
    problem = problem_of(wanted.module, wanted.parameters, wanted.inputs, wanted.model)
    key = _key(wanted, problem)
    entries = wanted.folder and Entries(wanted.folder)
    kept = entries and _kept(entries.get(key))
    if kept:
        wanted.report(1.0)
        return kept
    made = _made(wanted, problem)
    if entries:
        entries.put(key, _content(made))
    return made


def _made(wanted: ReferenceOptions, problem: Problem) -> Reference:
    """The same, computed now."""
    began, t_end, doubles = time.monotonic(), wanted.t_end, wanted.doubles
    states, units = wanted.module.STATES, wanted.module.UNITS
    times = np.linspace(0.0, t_end, ROWS)
    watched = problem
    if not doubles:
        watched = paced(problem, t_end, wanted.seconds, lambda _: wanted.report(0.0))
    try:
        rough = _roughly(watched, t_end, wanted.rest_speed)
    except TooLongError as reason:
        raise RunError(f"no run of {t_end:g} s: {reason} already") from None
    scale, found = measure.scales(states, units, rough), None
    if problem.contacts is None and wanted.seconds > 0 and wanted.model is not None:
        try:
            found = _in_long_numbers(wanted, program_of(wanted.model), problem, times, scale)
        except (TooLongError, ArithmeticError, ValueError) as reason:
            why = str(reason)
    else:
        why = "rigid contacts" if problem.contacts else "as asked"
    if not (found or doubles):
        raise RunError(f"no run of {t_end:g} s in extended precision: {why}")
    y, other, extent, origin = found or _in_doubles(wanted, problem, times, scale, why)
    scale = measure.scales(states, units, extent)
    apart = np.max((np.abs(other - y) + np.spacing(np.abs(y))) / scale, axis=1)
    spent = time.monotonic() - began
    return Reference(times, y, scale, float(apart.max()), float(apart[-1]), origin, spent)


def _in_long_numbers(
    wanted: ReferenceOptions,
    program: Program,
    problem: Problem,
    times: FloatArray,
    scale: FloatArray,
) -> _Found:
    """The motion by Gauss collocation. Raises `TooLongError` if it exceeds the time allowed."""
    began = time.process_time()
    motion = (wanted.module, wanted.parameters, wanted.inputs, problem.initial)

    def run(
        stages: tuple[int, ...], tolerance: float, before: float, share: float
    ) -> tuple[ExtendedArray, Row]:
        found: list[ExtendedArray] = []
        calls = count()

        def report(t: float) -> None:
            if next(calls) % SELDOM:  # checking the time takes as long as a step
                return
            done = before + share * t / float(times[-1])
            wanted.report(done)
            spent = time.process_time() - began
            _check_pace(spent, done, wanted.seconds, "extended precision")

        exactly = precise(program, *motion, fix_branches=True)
        with digits():
            for row in rows(stages, exactly, problem, scale, times, tolerance, report):
                found.append(row.y)
        wanted.report(before + share)
        return np.array(found), row

    # The looser run goes first: if the time does not suffice, less of it is lost.
    loose, _ = run(*LOOSE, 0.0, 0.4)
    tight, last = run(*TIGHT, 0.4, 0.6)
    with digits():
        off = np.abs(loose - tight).astype(float)
    y = tight.astype(float)
    origin = (
        f"Gauss collocation of order up to {2 * TIGHT[0][-1]} in {BITS} bits, {last.steps} steps; "
        "error: of the same with fewer stages and a looser tolerance, and of rounding to doubles"
    )
    return y, y + off, last.extent, origin


def _check_pace(spent: float, done: float, seconds: float, numbers: str) -> None:
    """Raise `TooLongError` if the time is used up, or clearly will be."""
    if spent > seconds or (spent > _JUDGED * seconds and spent > 1.5 * done * seconds):
        raise TooLongError(f"more than {seconds:g} s in {numbers}")


def _roughly(problem: Problem, t_end: float, rest_speed: float | None) -> FloatArray:
    """The least and greatest value of each state in a quick run, (2, ny).

    Raises `RunError` if the run does not reach the end.
    """
    tally = Tally()
    method = "LSODA" if problem.projection is None else "Rodas5P"
    run = integrate(
        problem, method, t_end, rtol=1e-6, atol=1e-8, samples=2, rest_speed=rest_speed, tally=tally
    )
    if not run.finished:
        raise RunError(f"reference: {run.message}")
    return np.array([tally.low, tally.high])


def _in_doubles(
    wanted: ReferenceOptions, problem: Problem, times: FloatArray, scale: FloatArray, why: str
) -> _Found:
    """The motion by two methods in doubles."""
    found = []
    for i, (method, rtol) in enumerate((("DOP853", SMALLEST_RTOL), ("Rodas5P", 1e-12))):
        tally = Tally()

        def report(done: float, i: int = i) -> None:
            wanted.report((i + done) / 2)

        run = integrate(
            problem,
            method,
            float(times[-1]),
            rtol=rtol,
            atol=0.1 * rtol * float(np.min(scale)),
            samples=len(times),
            progress=report,
            rest_speed=wanted.rest_speed,
            tally=tally,
        )
        if not run.finished:
            raise RunError(f"reference: {method}: {run.message}")
        found.append(np.array([run.y[np.searchsorted(run.t, t)] for t in times]))
    return (
        found[0],
        2 * found[1] - found[0],  # which of the two is more accurate is not known
        np.array([tally.low, tally.high]),
        f"DOP853 in doubles at rtol {SMALLEST_RTOL:g} ({why}); error: twice the difference from "
        "Rodas5P at rtol 1e-12",
    )


def _key(wanted: ReferenceOptions, problem: Problem) -> str:
    """A digest of everything that the reference depends on."""
    module: Any = wanted.module
    parameters, inputs = wanted.parameters, wanted.inputs
    source = module.__spec__.loader.get_source(module.__spec__.name) or ""
    given = [module.PARAMETERS if parameters is None else parameters]
    given += [module.INPUTS if inputs is None else inputs]
    values = [list(g.items()) if hasattr(g, "keys") else np.asarray(g).tolist() for g in given]
    times = (float(wanted.t_end), float(wanted.seconds))
    parts = (FORMAT, source, values, problem.initial.tolist(), times, wanted.rest_speed)
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def save(made: Reference, path: Path) -> None:
    """Write a reference as NumPy's .npz, atomically. Raises `RunError` if that fails."""
    write_whole(path, _content(made))


def _content(made: Reference) -> bytes:
    """A reference as NumPy's .npz."""
    buffer = io.BytesIO()
    np.savez(  # `eomgen` comes first: it marks the file as ours
        buffer,
        eomgen=np.array(FORMAT),
        t=made.t,
        y=made.y,
        scale=made.scale,
        errors=np.array([made.error, made.final_error, made.seconds]),
        origin=np.array(made.origin),
    )
    return buffer.getvalue()


def _kept(content: bytes | None) -> Reference | None:
    """The reference stored as these bytes; None if there are none."""
    if content is None:
        return None
    with np.load(io.BytesIO(content), allow_pickle=False) as members:
        error, final_error, seconds = members["errors"].tolist()
        y, scale, origin = members["y"], members["scale"], str(members["origin"])
        return Reference(members["t"], y, scale, error, final_error, origin, seconds)
