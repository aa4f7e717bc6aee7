"""Equilibria of a mechanism: positions, controller states and inputs at which it stays at rest."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eomgen.base.errors import RunError, nearest
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.run.tangents import tangents
from eomgen.study.linear.linearise import (
    evaluated,
    input_jacobian,
    input_values,
    rate_unit,
)
from eomgen.study.linear.manifold import directions, is_constrained, returned

MOST_STEPS = 60
"""Greatest number of steps to the nearest equilibrium; a near one takes few."""
MOST_SETTLING = 500
"""Greatest number of steps of the overdamped motion."""
LONGEST = 1.0
"""Greatest rotation in one step, rad: a longer one could miss nearer equilibria."""
CLOSE = 1e-10
"""Smaller accelerations, relative to those caused by a displacement of 1 rad or 1 m, count as
rounding."""
LONGEST_SETTLING = 0.3
"""Greatest rotation in one step of the overdamped motion, rad."""
GROWING = 1e-6
"""Greater growth rates, 1/s², relative to the fastest, make an equilibrium unstable."""
NUDGE = 1e-3
"""Displacement that starts the motion from an unstable equilibrium, rad or m."""
LOST = 1e6
"""Displacement in one step, m, that shows that something falls without end."""


class Equilibrium(NamedTuple):
    """A state `y` (ny,) at rest that does not change under the inputs `u` (nu,), SI units."""

    y: FloatArray
    u: FloatArray


def equilibrium(
    module: GeneratedModule,
    guess: FloatArray,
    u: Any = None,
    p: Any = None,
    *,
    hold: Sequence[str] = (),
    trim: Sequence[str] = (),
    settle: bool = False,
) -> Equilibrium:
    """Find a stable or unstable equilibrium near the positions and controller states of `guess`
    (ny,), whose velocities are ignored: those of an equilibrium are 0.

    hold    coordinates that stay as guessed; one component of a quaternion stands for all four
    trim    inputs to be found as well, near their values in `u`
    settle  follow the overdamped motion to a stable equilibrium, instead of going to the nearest
            one. That is also done if no equilibrium is near. Not with `trim`

    Coordinates that have no effect, such as the position of a floating body, stay as guessed.
    Raises `RunError`, naming the fastest change that is left, if no equilibrium is found.
    """
    if settle and trim:
        raise RunError("equilibrium: inputs are trimmed for the nearest equilibrium only")
    search = _Search(module, p, _held(module, hold), _trimmed(module, trim))
    start = search.point(np.array(guess, dtype=np.float64), input_values(module, u))
    best = start
    for attempt in (_settled,) if settle else (_nearest,) if trim else (_nearest, _settled):
        found = _nearest(search, attempt(search, start))
        if search.at_rest(found):
            return Equilibrium(found.y, found.u)
        best = min(best, found, key=lambda point: point.largest)
    raise RunError(_not_found(module, best, search.slopes(best)))


@dataclass(frozen=True, eq=False)
class _Point:
    """The mechanism at rest at the positions of `y` under `u`, with its `changes` (nv + nx,): the
    rates of velocities and of controller states.
    """

    y: FloatArray
    u: FloatArray
    changes: FloatArray

    @property
    def largest(self) -> float:
        """The largest change, in SI units."""
        return float(np.max(np.abs(self.changes), initial=0.0))

    @property
    def size(self) -> float:
        """The norm of all changes; it may overflow or be nan."""
        return float(np.sqrt(np.sum(self.changes**2)))


class _Search:
    """Evaluates a module at points, and steps between them.

    The unknowns are small displacements, three rotations for a quaternion, then the controller
    states, then the inputs. `free` are the indices of those that may change; `moving` are those of
    the free ones that are not inputs.
    """

    def __init__(
        self, module: GeneratedModule, p: Any, held: NDArray[np.bool_], trimmed: NDArray[np.bool_]
    ) -> None:
        self._module, self._p = module, p
        self._nq, self._nv = len(module.POSITIONS), len(held)
        self._nx = len(module.STATES) - self._nq - self._nv
        self._rotations = np.append(_rotations(module), np.zeros(self._nx, dtype=np.bool_))
        held = np.append(held, np.zeros(self._nx, dtype=np.bool_))
        self.free = np.flatnonzero(np.concatenate([~held, trimmed]))
        self.moving = np.flatnonzero(~held)
        self._displaced = self.moving[self.moving < self._nv]
        self._constrained = is_constrained(module)

    def point(self, y: FloatArray, u: FloatArray) -> _Point:
        """The point at the positions of `y`, with velocities 0 and quaternions normalised."""
        if not np.isfinite(y).all():
            raise RunError("equilibrium: the positions are not finite; start elsewhere")
        y = y.copy()
        y[self._nq : self._nq + self._nv] = 0.0
        for indices in self._module.QUATERNIONS:
            y[list(indices)] /= np.linalg.norm(y[list(indices)])
        if self._constrained:
            y = returned(self._module, y, self._p, u, self._displaced)
        return _Point(y, u, self._evaluated(self._module.derivative, y, u)[self._nq :])

    def slopes(self, point: _Point) -> FloatArray:
        """Derivatives of the changes with respect to the free unknowns, (nv + nx, nf), along
        displacements that keep the constraints.
        """
        found = self._slopes(point)
        if self._constrained:
            count = len(self._displaced)
            along = directions(self._module, point.y, self._p, point.u, self._displaced)
            found[:, :count] = found[:, :count] @ along
        return found

    def _slopes(self, point: _Point) -> FloatArray:
        by_state = self._evaluated(self._module.jacobian, point.y, point.u)[self._nq :]
        by_position = by_state[:, : self._nq] @ self._tangents(point)
        by_displacement = np.hstack([by_position, by_state[:, self._nq + self._nv :]])
        if np.max(self.free, initial=0) < self._nv + self._nx:
            return np.asarray(by_displacement[:, self.free])
        by_input = self._evaluated(input_jacobian(self._module), point.y, point.u)[self._nq :]
        return np.hstack([by_displacement, by_input])[:, self.free]

    def at_rest(self, point: _Point, slopes: FloatArray | None = None) -> bool:
        """Whether the changes that are left are rounding errors."""
        slopes = self.slopes(point) if slopes is None else slopes
        return point.largest <= CLOSE * max(1.0, float(np.max(np.abs(slopes), initial=0.0)))

    def rotation(self, step: FloatArray) -> float:
        """The greatest rotation in a step of the moving unknowns, rad."""
        return float(np.max(np.abs(step[self._rotations[self.moving]]), initial=0.0))

    def moved(self, point: _Point, step: FloatArray) -> _Point:
        """The point after a step of the free unknowns, shortened if a rotation is too large."""
        nv, inputs = self._nv, self._nv + self._nx
        whole = np.zeros(inputs + len(point.u))
        whole[self.free] = step
        rotation = float(np.max(np.abs(whole[:inputs][self._rotations]), initial=0.0))
        whole *= min(1.0, LONGEST / rotation) if rotation else 1.0
        y = point.y.copy()
        y[: self._nq] += self._tangents(point) @ whole[:nv]
        y[self._nq + nv :] += whole[nv:inputs]
        return self.point(y, point.u + whole[inputs:])

    def _tangents(self, point: _Point) -> FloatArray:
        return tangents(point.y[: self._nq], self._module.QUATERNIONS)

    def _evaluated(
        self, function: Callable[..., FloatArray], y: FloatArray, u: FloatArray
    ) -> FloatArray:
        return evaluated(function, y, self._p, u, "equilibrium")


def _nearest(search: _Search, point: _Point) -> _Point:
    """Minimise the changes by Levenberg and Marquardt's method until no step reduces them.

    Nocedal, Wright, Numerical Optimization, section 10.3. The damping leaves unknowns without
    effect as they are.
    """
    damping, scale = 1e-3, np.zeros(len(search.free))
    slopes = search.slopes(point)
    for _ in range(MOST_STEPS if len(search.free) else 0):
        scale = np.maximum(scale, np.linalg.norm(slopes, axis=0))
        # Unknowns whose effect is rounding must not be scaled up to have one.
        scales = np.maximum(scale, 1e-8 * np.max(scale)) if np.any(scale) else np.ones(len(scale))
        matrix = np.vstack([slopes / scales, np.sqrt(damping) * np.eye(len(scale))])
        right = np.concatenate([-point.changes, np.zeros(len(scale))])
        new = search.moved(point, np.linalg.lstsq(matrix, right)[0] / scales)
        better = new.size < point.size
        done = search.at_rest(point, slopes) and not new.size < point.size / 2
        if better:
            point, damping = new, max(damping / 10, 1e-14)
            slopes = search.slopes(point)
        else:
            damping *= 10
        if done or damping > 1e8:
            break
    return point


def _settled(search: _Search, point: _Point) -> _Point:
    """Follow the overdamped motion q' = v̇(q) by implicit steps that grow as it slows down.
    Controller states follow their own rates.

    Pseudo-transient continuation: C. T. Kelley, D. E. Keyes, SIAM J. Numer. Anal. 35 (1998), 508.
    A step is shorter than the growth time of an unstable mode: a longer one would go back to the
    unstable equilibrium. A small displacement starts the motion from an unstable equilibrium.
    """
    duration = 0.0
    for _ in range(MOST_SETTLING if len(search.moving) else 0):
        slopes = search.slopes(point)
        square = slopes[search.moving]
        rates, vectors = np.linalg.eig(square)
        fastest = float(np.max(np.abs(square)))
        growing = int(np.argmax(rates.real))
        rate = float(rates.real[growing])
        if search.at_rest(point, slopes):
            if rate <= GROWING * fastest:
                break
            direction = vectors[:, growing].real
            step = NUDGE * direction / np.max(np.abs(direction))
        else:
            duration = duration or 1.0 / max(1.0, fastest)
            duration = min(duration, 0.5 / rate) if rate > 0 else duration
            step, duration = _implicit_step(search, point, square, duration)
            if not np.max(np.abs(step)) < LOST:
                break
        new = search.moved(point, step)
        if not np.isfinite(new.size):
            break
        duration *= float(np.clip(2 * point.size / max(new.size, 1e-300), 0.5, 4.0))
        point = new
    return point


def _implicit_step(
    search: _Search, point: _Point, square: FloatArray, duration: float
) -> tuple[FloatArray, float]:
    """A step of the overdamped motion, and its duration, reduced if a rotation is too large."""
    while True:
        matrix = np.eye(len(square)) / duration - square
        step: FloatArray = np.linalg.lstsq(matrix, point.changes[search.moving])[0].astype(float)
        rotation = search.rotation(step)
        if not rotation > LONGEST_SETTLING:
            return step, duration
        duration *= 0.7 * LONGEST_SETTLING / rotation


def _rotations(module: GeneratedModule) -> NDArray[np.bool_]:
    """Which of the small displacements are rotations, rad; (nv,) of booleans."""
    firsts = {indices[0] for indices in module.QUATERNIONS}
    rest = {i for indices in module.QUATERNIONS for i in indices}
    found: list[bool] = []
    for i in range(len(module.POSITIONS)):
        if i in firsts:
            found += [True, True, True]
        elif i not in rest:
            found.append(module.UNITS[module.STATES[i]] == "rad")
    return np.array(found, dtype=np.bool_)


def _held(module: GeneratedModule, names: Iterable[str]) -> NDArray[np.bool_]:
    """Which small displacements are held."""
    positions = module.STATES[: len(module.POSITIONS)]
    held: set[int] = set()
    for name in names:
        if name not in positions:
            hint = nearest(name, positions) or f"; known: {', '.join(positions)}"
            raise RunError(f"hold: no coordinate '{name}'{hint}")
        index = positions.index(name)
        held.update(*(q for q in module.QUATERNIONS if index in q), (index,))
    indicator = np.array([float(i in held) for i in range(len(positions))])
    columns = tangents(np.ones(len(positions)), module.QUATERNIONS)
    return np.asarray(np.abs(columns).T @ indicator > 0)


def _trimmed(module: GeneratedModule, names: Iterable[str]) -> NDArray[np.bool_]:
    """Which inputs are to be found."""
    for name in names:
        if name not in module.INPUTS:
            hint = nearest(name, module.INPUTS) or f"; known: {', '.join(module.INPUTS) or 'none'}"
            raise RunError(f"trim: no input '{name}'{hint}")
    return np.array([name in set(names) for name in module.INPUTS], dtype=np.bool_)


def _not_found(module: GeneratedModule, point: _Point, slopes: FloatArray) -> str:
    worst = int(np.argmax(np.abs(point.changes)))
    name = module.STATES[len(module.POSITIONS) + worst]
    left = f"{name} still changes by {point.changes[worst]:.4g} {rate_unit(module.UNITS[name])}"
    downhill = np.linalg.norm(slopes.T @ point.changes)
    if downhill <= 1e-6 * np.linalg.norm(slopes) * point.size:
        return (
            f"no equilibrium: {left}, and no free coordinate or input affects that; "
            "start elsewhere, trim an input, or change the effects"
        )
    return f"no equilibrium found: {left}; start elsewhere, trim an input, or change the effects"
