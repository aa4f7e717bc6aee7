"""How leaving something out changes a motion: two runs, and the distance between them.

The distance d between the two mechanisms is the root mean square, in m, of the displacement of all
mass: d² = Σ ∫ |Δx|² dm / Σ m. It covers positions and angles: for a rigid body ∫ |Δx|² dm =
m |Δx_com|² + tr(ΔR J ΔRᵀ), J = ∫ r rᵀ dm. It is given relative to the extent of the motion: the
greatest distance of the whole scene's run from its own start. Chaotic motions diverge until d is as
large as the motion itself: about 100 % or more means that the motions have nothing in common.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eomgen.model.model import Model
from eomgen.run.integrate import integrate
from eomgen.run.integrators import EndedRunError, FixedStep, find_integrator
from eomgen.run.module import GeneratedModule, as_problem
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.progress import Progress
from eomgen.scene.schema import Simulation
from eomgen.tables.poses import places_of, rotations_of

SMALL = 0.01
"""A motion counts as changed beyond this part of the extent."""
STILL = 1e-9
"""With a smaller extent, m, nothing moves."""
FINEST = (1e-6, 1e-9)
"""Tightest relative and absolute tolerance of the runs that are compared."""
MOST_ROWS = 2001
"""Greatest number of times at which two motions are compared."""
OVER = "no time to compute more"
FAR_ENOUGH = "the other run ends here"


@dataclass(frozen=True)
class Run:
    """A motion: times (n,), poses (n, nb, …) as from `body_poses`, and why it ended early."""

    t: FloatArray
    poses: FloatArray
    ended: str


@dataclass(frozen=True)
class Change:
    """How far two motions diverge.

    relative  greatest d relative to the extent; nan if nothing moves
    since     first time at which d exceeds `SMALL` of the extent, s; None if it never does
    distance  greatest distance between the two positions of a centre of mass, m, that of `body`
    angle     greatest angle between the two orientations of a body, rad
    until     the time up to which they were compared, s
    ended     why not further; "" if that is the end
    """

    relative: float
    since: float | None
    distance: float
    body: str
    angle: float
    until: float
    ended: str

    @property
    def percent(self) -> str:
        """`relative` in percent with at least two digits; "-" if nothing moves."""
        if math.isnan(self.relative):
            return "-"
        value = 100 * self.relative
        return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def run(
    wanted: Simulation, module: GeneratedModule, seconds: float, until: float, progress: Progress
) -> Run:
    """A scene's run, with its inputs at 0, limited to `seconds` of wall time and to time
    `until`.

    It uses the `wanted` integrator, step and tolerances, but none below `FINEST`, which is enough
    for fractions of a percent. The module needs only its derivative and `body_poses`.
    """
    fixed = isinstance(find_integrator(wanted.integrator), FixedStep)
    trajectory = integrate(
        _timed(module, time.perf_counter() + seconds, until),
        wanted.integrator,
        wanted.t_end,
        dt=wanted.dt if fixed else None,
        rtol=max(wanted.rtol, FINEST[0]),
        atol=None if wanted.atol is None else max(wanted.atol, FINEST[1]),
        progress=progress,
    )
    if trajectory.outcome.kind == "interrupted":
        raise KeyboardInterrupt
    ended = ""
    if not trajectory.finished:
        outcome = trajectory.outcome
        breaks_off = f"it breaks off at t = {trajectory.t[-1]:.4g} s"
        ended = outcome.reason if outcome.kind == "ended" else breaks_off
    few = slice(None, None, math.ceil(len(trajectory.t) / MOST_ROWS))
    t = trajectory.t[few]
    with np.errstate(all="ignore"):  # a driving formula may not be finite at all times
        poses = np.moveaxis(module.body_poses(t, trajectory.y[few].T), -1, 0)
    return Run(t, poses, ended)


def _timed(module: GeneratedModule, due: float, until: float) -> Problem:
    """The initial-value problem of a module; its derivative ends the run when time is up."""
    problem = as_problem(module)

    def derivative(t: float, y: FloatArray) -> FloatArray:
        if time.perf_counter() > due:
            raise EndedRunError(OVER)
        if t > until:
            raise EndedRunError(FAR_ENOUGH)
        return problem.derivative(t, y)

    return replace(problem, derivative=derivative)


def extent(model: Model, motion: Run) -> float:
    """The greatest distance of a motion from its start, m, by the measure of this module."""
    return float(np.max(distances(model, motion.poses, motion.poses[:1])))


def change(model: Model, whole: Run, other: Run, size: float) -> Change:
    """How far another run departs from that of the whole scene; `size` is the extent, m."""
    _, i, j = np.intersect1d(whole.t, other.t, return_indices=True)
    t, one, two = whole.t[i], whole.poses[i], other.poses[j]
    apart = distances(model, one, two)
    moving = size > STILL
    late = np.flatnonzero(apart > SMALL * size) if moving else np.array([], dtype=int)
    gaps = places_of(one) - places_of(two)
    gap = np.sqrt(np.sum(gaps * gaps, axis=-1))
    farthest = np.unravel_index(int(np.argmax(gap)), gap.shape)
    ends = [ended for ended in (other.ended, whole.ended) if ended not in ("", FAR_ENOUGH)]
    return Change(
        relative=float(np.max(apart)) / size if moving else math.nan,
        since=float(t[late[0]]) if late.size else None,
        distance=float(gap[farthest]),
        body=model.bodies[int(farthest[1])].name,
        angle=float(np.max(_angles(one, two))),
        until=float(t[-1]),
        ended=ends[0] if ends else "",
    )


def distances(model: Model, one: FloatArray, two: FloatArray) -> FloatArray:
    """The distance d between each row of two motions, (n,), m: root mean square over all mass."""
    total: FloatArray = np.zeros(len(one))
    moved = np.sum((places_of(one) - places_of(two)) ** 2, axis=-1)
    turned = rotations_of(one) - rotations_of(two)
    masses = [model.value(body.mass) for body in model.bodies]
    for k, body in enumerate(model.bodies):
        inertia = [model.value(part) for part in body.inertia_com]
        spread = np.einsum("nij,jk,nik->n", turned[:, k], _second_moment(inertia), turned[:, k])
        total = total + masses[k] * moved[:, k] + spread
    return np.asarray(np.sqrt(np.maximum(total, 0.0) / sum(masses)))


def _second_moment(inertia: Sequence[float]) -> FloatArray:
    """J = ∫ r rᵀ dm from the moments of inertia: ½ tr(I) 1 - I. In the plane, one of several J."""
    if len(inertia) == 1:
        return np.asarray(np.eye(2) * inertia[0] / 2)
    xx, yy, zz, xy, xz, yz = (*inertia, 0.0, 0.0, 0.0)[:6]
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.asarray(np.trace(matrix) / 2 * np.eye(3) - matrix)


def _angles(one: FloatArray, two: FloatArray) -> FloatArray:
    """Angle between the two orientations of each body, 0 to π, (n, nb).

    In the plane and in space, |ΔR|² is 4 (1 - cos) or, what is the same, 8 sin²(½ angle).
    """
    turned = rotations_of(one) - rotations_of(two)
    half = np.sqrt(np.sum(turned * turned, axis=(-2, -1)) / 8)
    return np.asarray(2 * np.arcsin(np.minimum(half, 1.0)))
