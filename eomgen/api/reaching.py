"""Inverse kinematics: coordinates at which points of bodies are where they are wanted."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from eomgen.api.generating import compiled
from eomgen.api.given import Source, check, named, values_of
from eomgen.api.public import public
from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.base.frozen import Frozen
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.run.problem import FloatArray

NEEDED = ("frame_jacobians", "point_positions", "body_poses")
STEPS = 100
"""Most steps from one start."""
LITTLE = 1e-14
"""Damping beside that by the error, in squares of m or rad."""
LONGEST = 1.0
"""Greatest change of a coordinate in a step, rad or m."""


@dataclass(frozen=True, repr=False)
class Reached(Frozen, Displayed):
    """What an inverse kinematics found.

    coordinates  by name, rad or m: as `state` of `simulate` takes them
    q            the same as an array
    error        the greatest distance from a target, m or rad
    converged    whether it is within the tolerance
    starts       how many starts it took
    """

    shown = ("coordinates", "error", "converged", "starts")

    coordinates: Mapping[str, float]
    q: FloatArray
    error: float
    converged: bool
    starts: int


class Kinematics:
    """Places of a scene's points, and the coordinates for wanted ones. Made by `kinematics`."""

    def __init__(self, model: Model, module: Any, parameters: FloatArray) -> None:
        self._model, self._module, self._p = model, module, parameters
        self.names = tuple(c.name for c in model.coordinates)
        self.points = tuple(point.name for point in model.points)
        self._start = np.array(module.initial_state(parameters), dtype=float)
        moving = [body for body in model.bodies if body.positions]
        limits = {b.positions[0].name: getattr(b.joint, "limits", None) for b in moving}
        bounds = [limits.get(name) or (-math.inf, math.inf) for name in self.names]
        self.low, self.high = np.array(bounds, dtype=float).reshape(-1, 2).T

    def reach(
        self,
        targets: Mapping[str, ArrayLike],
        *,
        start: Mapping[str, float] | None = None,
        tolerance: float = 1e-9,
        starts: int = 50,
        seed: int = 0,
    ) -> Reached:
        """Coordinates within the limits of joints at which points are at their targets.

        targets    for each point a position (3,), an orientation (3, 3) of its body in the world,
                   or both: [R | position] (3, 4), or the same with a last row; in the plane a
                   position (2,), or x, y and the angle of the body (3,)
        start      coordinates to begin from, by name; the scene's own where none is given
        tolerance  greatest distance of a point, m, and angle, rad
        starts     most starts: the given one, then random ones
        seed       of the random ones

        Damped Newton steps (T. Sugihara, "Solvability-unconcerned inverse kinematics by the
        Levenberg-Marquardt method", IEEE Transactions on Robotics 27, 2011); coordinates that would
        leave their limits stay there. Constraints are met, too. Without a solution the nearest
        found is returned, `converged` is false. Raises `RunError` for an unknown point, or a target
        of another shape.
        """
        wanted = [self._target(name, value) for name, value in targets.items()]
        rng, best = np.random.default_rng(seed), None
        for count in range(max(1, starts)):
            q = self._given(start) if count == 0 else self._random(rng)
            q, error = self._descend(q, wanted, tolerance)
            if best is None or error < best[1]:
                best = q, error, count + 1
            if error <= tolerance:
                break
        assert best is not None
        q, error, count = best
        values = dict(zip(self.names, q.tolist(), strict=True))
        return Reached(values, q, error, error <= tolerance, count)

    def place(self, point: str, q: ArrayLike) -> FloatArray:
        """A point as a target of `reach` at coordinates q: [R | position], or x, y and angle."""
        i = self._point(point)
        y = self._state(np.asarray(q, dtype=float))
        position = self._module.point_positions(0.0, y, self._p)[i]
        pose = self._module.body_poses(0.0, y, self._p)[self._model.points[i].body]
        if self._model.dimensions == 2:
            return np.array([*position, pose[2]])
        return np.column_stack((pose[:, :3], position))

    def _descend(
        self, q: FloatArray, wanted: "list[_Target]", tolerance: float
    ) -> tuple[FloatArray, float]:
        """Newton's steps from coordinates; the last ones, and how far they are off."""
        r, J = self._residual(q, wanted)
        for _ in range(STEPS):
            error = float(np.abs(r).max(initial=0.0))
            if error <= tolerance:
                break
            free = np.ones(J.shape[1], dtype=bool)
            for _ in range(J.shape[1] + 1):
                step = np.zeros(J.shape[1])
                A, damping = J[:, free], r @ r / 2 + LITTLE
                square = A.T @ A + damping * np.eye(A.shape[1])
                step[free] = np.linalg.solve(square, A.T @ r)
                step *= min(1.0, LONGEST / max(np.abs(step).max(initial=0.0), 1e-300))
                held = self._leaving(q, step) & free
                if not held.any():
                    break
                free &= ~held
            q = self._moved(q, step)
            before, (r, J) = r @ r, self._residual(q, wanted)
            if before - r @ r < 1e-12 * before and np.abs(r).max() > math.sqrt(tolerance):
                break
        return q, float(np.abs(r).max(initial=0.0))

    def _residual(self, q: FloatArray, wanted: "list[_Target]") -> tuple[FloatArray, FloatArray]:
        """What the targets are beyond the points, and the Jacobian of the points."""
        module, y = self._module, self._state(q)
        J = module.frame_jacobians(0.0, y, self._p)
        places = module.point_positions(0.0, y, self._p)
        poses = module.body_poses(0.0, y, self._p)
        n, rows, slopes = self._model.dimensions, [np.zeros(0)], [np.zeros((0, J.shape[2]))]
        for target in wanted:
            if target.position is not None:
                rows.append(target.position - places[target.point])
                slopes.append(J[target.point][:n])
            if target.turn is not None:
                pose = poses[self._model.points[target.point].body]
                rows.append(
                    np.array([math.remainder(target.turn[0] - pose[2], math.tau)])
                    if n == 2
                    else _angles(target.turn @ pose[:, :3].T)
                )
                slopes.append(J[target.point][n:])
        if self._model.constraints:
            rows.append(-module.constraint_residuals(0.0, y, self._p))
            slopes.append(module.constraint_jacobian(0.0, y, self._p))
        return np.concatenate(rows), np.concatenate(slopes)

    def _leaving(self, q: FloatArray, step: FloatArray) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Which velocities would take their coordinate from its limit outwards."""
        found = np.zeros(len(step), dtype=bool)
        for index in self._model.joint_indices:
            for i, j in index.plain:
                if j < len(step):
                    found[j] = (q[i] <= self.low[i] and step[j] < 0.0) or (
                        q[i] >= self.high[i] and step[j] > 0.0
                    )
        return found

    def _moved(self, q: FloatArray, step: FloatArray) -> FloatArray:
        """Coordinates after a step along the velocities, within their limits."""
        q = q.copy()
        for index in self._model.joint_indices:
            for i, j in index.plain:
                if j < len(step):
                    q[i] = min(max(q[i] + step[j], self.low[i]), self.high[i])
            if index.quaternion:
                turn = step[list(index.spin)]
                half = np.linalg.norm(turn) / 2
                part = np.array([math.cos(half), *(np.sinc(half / math.pi) / 2 * turn)])
                q[list(index.quaternion)] = _product(q[list(index.quaternion)], part)
        return q

    def _random(self, rng: np.random.Generator) -> FloatArray:
        angles = np.array(["rad" in c.unit for c in self._model.coordinates])
        reach = np.where(angles, math.pi, 1.0)
        low = np.where(np.isfinite(self.low), self.low, -reach)
        high = np.where(np.isfinite(self.high), self.high, reach)
        q = rng.uniform(np.minimum(low, high), np.maximum(low, high))
        for indices in map(list, self._model.quaternions):
            turn = rng.normal(size=4)
            q[indices] = turn / np.linalg.norm(turn)
        return q

    def _given(self, start: Mapping[str, float] | None) -> FloatArray:
        q = self._start[: len(self.names)].copy()
        for name, value in named(start, self.names, "start", "coordinate").items():
            q[self.names.index(name)] = value
        return np.asarray(np.clip(q, self.low, self.high))

    def _state(self, q: FloatArray) -> FloatArray:
        y = self._start.copy()
        y[: len(q)], y[len(q) : len(q) + len(self._model.velocities)] = q, 0.0
        return y

    def _point(self, name: str) -> int:
        if name not in self.points:
            raise RunError(f"targets: no point '{name}'; points: {', '.join(self.points)}")
        return self.points.index(name)

    def _target(self, name: str, value: ArrayLike) -> "_Target":
        point, array = self._point(name), np.asarray(value, dtype=float)
        shapes = ("(2,) or (3,)", "(3,), (3, 3), (3, 4) or (4, 4)")[self._model.dimensions - 2]
        if not np.isfinite(array).all():
            raise RunError(f"targets: that of '{name}' has a number that is not finite")
        if self._model.dimensions == 2 and array.shape in ((2,), (3,)):
            return _Target(point, array[:2], array[2:] if len(array) == 3 else None)
        if self._model.dimensions == 3 and array.shape == (3,):
            return _Target(point, array, None)
        if self._model.dimensions == 3 and array.shape in ((3, 3), (3, 4), (4, 4)):
            turn = array[:3, :3]
            if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) or np.linalg.det(turn) < 0:
                raise RunError(f"targets: that of '{name}' has no rotation matrix")
            return _Target(point, array[:3, 3] if array.shape[-1] > 3 else None, turn)
        raise RunError(f"targets: that of '{name}' has shape {array.shape}; give {shapes}")


@dataclass(frozen=True)
class _Target:
    """Where a point is wanted, and how its body is turned; None for anyhow."""

    point: int
    position: FloatArray | None
    turn: FloatArray | None


@public
def kinematics(source: Source, *, parameters: Mapping[str, float] | None = None) -> Kinematics:
    """The kinematics of a scene with points: `place` of a point, and `reach`, which finds the
    coordinates for wanted places.

    parameters  values by name, in place of the scene's

    Raises `SceneError`, or `RunError` if the scene has no points.
    """
    model = check(source)
    if not model.points:
        raise RunError("kinematics: the scene has no [[points]]; give some")
    model = replace(model, form="velocity", outputs=in_order(NEEDED), loops_kept="projected")
    _, module = compiled(model)
    values, _ = values_of(model, parameters, None)
    p = np.array([{**module.PARAMETERS, **values}[name] for name in module.PARAMETERS])
    return Kinematics(model, module, p)


def _angles(rotation: FloatArray) -> FloatArray:
    """The axis of a rotation times its angle, rad."""
    axial = np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    sine, cosine = np.linalg.norm(axial) / 2, (np.trace(rotation) - 1) / 2
    if sine > 1e-6:
        return np.asarray(axial * (math.atan2(sine, cosine) / (2 * sine)))
    if cosine > 0:
        return np.asarray(axial / 2)
    # Half a turn: the greatest column of R + 1 is along the axis.
    column = (rotation + np.eye(3))[:, int(np.argmax(np.diag(rotation)))]
    return np.asarray(math.pi * column / np.linalg.norm(column))


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """The product of quaternions, of length 1."""
    w, x = a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    found = np.array([w, *x])
    return np.asarray(found / np.linalg.norm(found))
