"""From a run and what is wanted of it to a figure or a film."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eomgen.base.errors import RunError
from eomgen.run.trajectory import Trajectory
from eomgen.show.filming import FilmOptions
from eomgen.show.motion import Array, Motion, thinned
from eomgen.show.plots import (
    draw_phase,
    draw_section,
    draw_series,
    draw_strobe,
    size_of,
)
from eomgen.study.between import Between, Direction, between
from eomgen.study.observed import Observed, observed
from eomgen.study.quantities import outputs_of, quantities
from eomgen.study.sections import section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from eomgen.run.progress import Progress

MOST_POSES = 50
"""Greatest number of poses in a strobe picture."""
SMOOTH = 4
"""Samples of a path for each frame of a film."""


@dataclass(frozen=True)
class Wanted:
    """What a figure shows; the fields are the arguments of `Run.plot`."""

    of: tuple[str, ...] = ()
    phase: tuple[str, ...] = ()
    poincare: tuple[str, ...] = ()
    at: str = ""
    direction: Direction = "rising"
    strobe: int | tuple[float, ...] = 0
    size: str = "double"


def names_of(given: str | Sequence[str]) -> tuple[str, ...]:
    """Names that are given one by one, or as a text with commas."""
    words = given.split(",") if isinstance(given, str) else given
    return tuple(filter(None, (word.strip() for word in words)))


@dataclass(frozen=True, eq=False)
class Plotted:
    """A figure and a note on it, or ""."""

    figure: "Figure"
    note: str = ""


def plotted(
    trajectory: Trajectory,
    motion: Motion,
    wanted: Wanted,
    called: Callable[[str], str] = str,
) -> Plotted:
    """The figure that is wanted of a run. Messages name a field of `wanted` as `called` does.

    Raises `RunError` for a name that the run does not have.
    """
    kinds = ("of", "phase", "poincare", "strobe")
    given = [kind for kind in kinds if getattr(wanted, kind)]
    if len(given) > 1:
        raise RunError(
            f"{', '.join(map(called, given))}: a figure shows one of them; leave the others out"
        )
    if bool(wanted.at) != bool(wanted.poincare):
        raise RunError(
            f"{called('poincare')}, {called('at')}: a section needs both, names and a condition "
            "such as 'phi = 0'"
        )
    size = size_of(wanted.size, called("size"))
    kind = given[0] if given else "of"
    names = wanted.of or tuple(motion.states[k] for k in motion.positions)
    if kind != "of":
        names = {"phase": wanted.phase, "poincare": wanted.poincare}.get(kind, ())
    run = observed(trajectory, outputs_of(names, trajectory, called(kind)))
    t, y = trajectory.t, trajectory.y
    if kind == "strobe":
        shown, rows = _posed(run, motion, _times(motion, wanted.strobe, called))
        return Plotted(draw_strobe(shown, rows, size))
    if kind == "poincare":
        if len(names) > 2:
            raise RunError(f"{called(kind)}: give one or two names")
        found = section(
            run, between(run), names, wanted.at, wanted.direction, argument=called("at")
        )
        _check_single(found.quantities, names, called(kind))
        count = len(found.t)
        return Plotted(
            draw_section(found, size),
            f"{count} crossing{'' if count == 1 else 's'} of {wanted.at}, by cubic interpolation "
            f"between {len(t)} rows; its error is about {found.error:.1g} of each state's range",
        )
    found_along = quantities(names, run, t, y, argument=called(kind))
    if kind == "phase":
        if len(names) != 2:
            raise RunError(f"{called(kind)}: give two names, theta,theta_dot for example")
        _check_single(found_along, names, called(kind))
        return Plotted(draw_phase(found_along[0], found_along[1], size))
    return Plotted(draw_series(t, found_along, size))


def _check_single(found: Sequence[object], names: Sequence[str], argument: str) -> None:
    """Raise `RunError` unless each name stands for one quantity."""
    if len(found) != len(names):
        raise RunError(
            f"{argument}: {', '.join(names)}: each must be one quantity, as joint_forces.NAME.fx"
        )


def _times(motion: Motion, strobe: int | tuple[float, ...], called: Callable[[str], str]) -> Array:
    """The times of a strobe picture. Raises `RunError` for too many, or times outside the run."""
    start, end = motion.t[0], motion.t[-1]
    if isinstance(strobe, int):
        times = np.linspace(start, end, strobe) if 1 <= strobe <= MOST_POSES else np.empty(0)
    else:
        times = np.array(sorted(strobe))
    if not 1 <= len(times) <= MOST_POSES:
        raise RunError(f"{called('strobe')}: give 1 to {MOST_POSES} poses")
    if not (np.isfinite(times).all() and start <= times[0] and times[-1] <= end):
        raise RunError(
            f"{called('strobe')}: the run is from {start:g} s to {end:g} s; give times within it"
        )
    return times


def _posed(run: Observed, motion: Motion, times: Array) -> tuple[Motion, list[int]]:
    """The motion with further samples at `times`, and their rows; states between rows are
    interpolated.
    """
    thin = thinned(motion)
    t = np.unique(np.concatenate([thin.t, times]))
    return _at(run, motion, t, between(run)), np.searchsorted(t, times).tolist()


def _at(run: Observed, motion: Motion, t: Array, states: Between) -> Motion:
    """The motion at other times."""
    y = states(t)
    return replace(
        motion,
        t=t,
        y=y,
        poses=run.output("body_poses", t, y),
        kinetic_energy=np.zeros(len(t)),
        potential_energy=np.zeros(len(t)),
        joint_drift=np.zeros((len(t), len(motion.joints))),
        works=None,
        effects=(),
    )


@dataclass(frozen=True)
class Filmed:
    """A film that was written: its path, number of frames, frames of a second, size in pixels."""

    path: Path
    frames: int
    fps: float
    size: tuple[int, int]


def filmed(
    trajectory: Trajectory,
    motion: Motion,
    path: Path,
    options: FilmOptions,
    progress: "Progress | None" = None,
) -> Filmed:
    """Write the film of a run, as `Run.film` does."""
    from eomgen.show.film import check_film, film_times, frame_rate, pixels_of, save_film

    check_film(path, force=options.force)
    pixels = pixels_of(options.size) if options.size else None
    if not 0 < options.fps <= 100:
        raise RunError(f"fps: {options.fps:g} is not a number from 1 to 100")
    fps, speed = frame_rate(path, options.fps), options.speed
    first, last = float(trajectory.t[0]), float(trajectory.t[-1])
    start = first if options.start is None else options.start
    end = last if options.end is None else options.end
    if not first <= start < end <= last:
        raise RunError(f"from, to: give times within the run, {first:g} s to {last:g} s")
    t = film_times(start, end, fps, speed)
    run = observed(trajectory)
    # Samples between the frames, for smooth paths.
    fine: Array = start + speed / fps / SMOOTH * np.arange(SMOOTH * (len(t) - 1.0) + 1)
    shown = _at(run, motion, fine, between(run))
    rows = range(0, len(fine), SMOOTH)
    ignored = progress or (lambda share: None)
    drawn = save_film(
        shown, rows, path, fps=fps, size=pixels, force=options.force, progress=ignored
    )
    return Filmed(path, len(t), fps, drawn)
