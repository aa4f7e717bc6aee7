"""Outputs for robotics beside Pinocchio, of a robot file at random states."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from robot_peers import Robot

import eomgen
from eomgen.codegen.from_recursion import output
from eomgen.codegen.recording import Recording
from eomgen.codegen.system import output_shape
from eomgen.dynamics.start.assembly import assembled
from eomgen.program.program import Output, finish, interpret
from eomgen.program.tape import TIME
from eomgen.scalars.floats import ArrayScalars
from eomgen.tables.outputs import IN_SPACE, OUTPUTS

Array = Any
FRAMES = {
    "": pin.LOCAL_WORLD_ALIGNED,
    "_local": pin.LOCAL,
    "_world": pin.WORLD,
}
ORDER = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
"""Pinocchio's order of inertial parameters."""
KNOWN = 1e-10 / 2.0**-52
"""The condition of M up to which 1e-10 is asked of what has M⁻¹; beyond it that times 2⁻⁵²."""
COMPARED = (
    *(f"frame_jacobians{end}" for end in FRAMES),
    *(f"frame_bias_accelerations{end}" for end in FRAMES),
    "point_positions",
    "mass_matrix",
    "gravity_force",
    "coriolis_matrix",
    "centre_of_mass",
    "centre_of_mass_jacobian",
    "centroidal_momentum_matrix",
    "regressor",
    "inverse_dynamics_derivatives",
    "operational_mobilities",
    "operational_inertias",
    "inverse_mass_matrix",
    "forward_dynamics_derivatives",
)


def differences(
    path: Path, floating: bool, states: int, rng: np.random.Generator
) -> tuple[int, dict[str, float]]:
    """The freedoms of a robot, and of each output its greatest difference at states."""
    robot = Robotics(path, floating, rng)
    sampled = [robot.sample(rng) for _ in range(states)]
    found = robot.outputs(sampled, rng)
    worst: dict[str, float] = {}
    for k, (q, v, basis) in enumerate(sampled):
        ours = {name: array[..., k] for name, array in found.items()}
        sizes, off = dict[str, float](), dict[str, float]()
        for name, own, other, condition, *scale in robot.compared(q, v, basis, ours):
            apart, size = (float(np.abs(x).max(initial=0.0)) for x in (own - other, other))
            sizes[name] = max(sizes.get(name, 1e-3), size, *scale)
            off[name] = max(off.get(name, 0.0), apart / max(1.0, condition / KNOWN))
        worst = {n: max(worst.get(n, 0.0), off[n] / sizes[n]) for n in off}
    return len(robot.model.velocities), worst


class Robotics(Robot):
    """A robot in both programs, without friction, with points on three links."""

    def __init__(self, path: Path, floating: bool, rng: np.random.Generator) -> None:
        super().__init__(path, floating)
        links = [link for link in self.links if self.pin.existFrame(link, pin.BODY)]
        chosen = {links[i] for i in (0, len(links) // 2, -1)}
        self.points = {
            link: rng.normal(size=3) for link in links if link in chosen and self.links[link]
        }
        self.tables = {
            **self.tables,
            "effects": [e for e in self.tables["effects"] if e["type"] in ("gravity", "motor")],
            "points": [
                {"name": f"point_{i}", "body": self.links[link], "at": at.tolist()}
                for i, (link, at) in enumerate(self.points.items())
            ],
        }
        self.model = assembled(eomgen.check(self.tables))
        for link, at in self.points.items():
            frame = self.pin.frames[self.pin.getFrameId(link, pin.BODY)]
            place = frame.placement * pin.SE3(np.eye(3), at)
            added = (f"{link} point", frame.parentJoint, 0, place, pin.OP_FRAME)
            self.pin.addFrame(pin.Frame(*added))
        self.data = self.pin.createData()
        self.root = self.pin.joints[1].nv == 6 if self.pin.njoints > 1 else False
        turns = [j.nv for j in list(self.pin.joints)[2 if self.root else 1 :]]
        self.constant = max(turns, default=1) == 1  # all else of T

    def outputs(
        self, sampled: list[tuple[Array, Array, Array]], rng: np.random.Generator
    ) -> dict[str, Array]:
        """All outputs at states, with v̇ and τ at random, (..., n)."""
        record, nodes, extra = Recording(self.model, "aba"), {}, {}
        for name in COMPARED:
            if OUTPUTS[name].needs == "points" and not self.points:
                continue
            record.model = self.model
            if name == "operational_inertias":  # of points that can move in all ways
                enough = [self._ways(link) >= 6 for link in self.points]
                self.mobile = [i for i, most in enumerate(enough) if most]
                points = tuple(self.model.points[i] for i in self.mobile)
                record.model = replace(self.model, points=points)
            nodes[name] = output(record, name, extra)
        shapes = {name: output_shape(name, self.model) for name in nodes}
        shapes["operational_inertias"] = (len(self.mobile), 6, 6)
        made = {
            name: Output(shapes[name], tuple(x.index for x in part)) for name, part in nodes.items()
        }
        program = finish(record.tape, made, ())
        ys = np.array([self.to.state(q, v) for q, v, _ in sampled]).T
        names = [c.name for c in (*self.model.coordinates, *self.model.velocities)]
        nv, n = len(self.model.velocities), len(sampled)
        self.vd, self.tau = rng.normal(size=(2, nv, n))
        given = {**self.model.defaults, TIME: 0.0, **{i.name: 0.0 for i in self.model.inputs}}
        given |= dict(zip(names, ys, strict=False))
        for prefix, values in (("vd", self.vd), ("tau", self.tau)):
            rows = zip(self.model.velocities, values, strict=True)
            given |= {f"{prefix}__{c.name}": row for c, row in rows}
        found = {}
        for name, shape in shapes.items():
            with np.errstate(all="ignore"):
                entries = interpret(program, name, given, ArrayScalars())
            whole = [np.broadcast_to(x, n) for x in entries]
            found[name] = np.array(whole).reshape(*shape, n)
        self.k = 0
        return found

    def _ways(self, link: str) -> int:
        """How many velocities move a link."""
        q, k = pin.neutral(self.pin), self.pin.getFrameId(link, pin.BODY)
        J = pin.computeFrameJacobian(self.pin, self.data, q, k, pin.LOCAL)
        return int(np.any(J, axis=0).sum())

    def compared(
        self, q: Array, v: Array, basis: Array, ours: dict[str, Array]
    ) -> Iterator[tuple[Any, ...]]:
        """Each output, ours and Pinocchio's in our velocities, the condition of M, and the size of
        its terms if they may cancel.
        """
        model, data = self.pin, self.data
        vd, tau = self.vd[:, self.k], self.tau[:, self.k]
        self.k += 1
        y = self.to.state(q, v)
        nq, nv = len(self.model.coordinates), len(self.model.velocities)
        T = np.array(
            [self.to.velocity(np.concatenate((y[:nq], row))) for row in np.eye(nv)]
        ).T.reshape(model.nv, nv)
        own = y[nq : nq + nv]
        rate, slopes = self._rates(T, own)
        a = T @ vd + rate @ own
        pin.computeAllTerms(model, data, q, v)
        pin.computeJointJacobiansTimeVariation(model, data, q, v)
        pin.updateFramePlacements(model, data)
        mass = np.array(data.M)
        mass = np.triu(mass) + np.triu(mass, 1).T
        yield "mass_matrix", ours["mass_matrix"], T.T @ mass @ T, 1.0
        gravity = pin.computeGeneralizedGravity(model, data, q)
        yield "gravity_force", ours["gravity_force"], T.T @ gravity, 1.0
        h = pin.nonLinearEffects(model, data, q, v)
        C = ours["coriolis_matrix"]
        if self.constant:
            yield "coriolis_matrix", C @ own, T.T @ (h - gravity + mass @ rate @ own), 1.0
        if self.constant and not self.root:
            theirs = pin.computeCoriolisMatrix(model, data, q, v)
            yield "coriolis_matrix", C, T.T @ theirs @ T, 1.0
        yield from self._momentum(q, v, T, ours)
        yield from self._regressor(q, v, a, T, ours)
        # What moves: B z, with a basis of velocities that mimic others.
        B = np.linalg.lstsq(T, basis, rcond=None)[0]
        M = B.T @ T.T @ mass @ T @ B
        scaled = B / np.sqrt(np.diag(M))
        whole = scaled.T @ T.T @ mass @ T @ scaled
        W, condition = scaled @ np.linalg.solve(whole, scaled.T), float(np.linalg.cond(whole))
        yield "inverse_mass_matrix", ours["inverse_mass_matrix"], W, condition
        yield from self._frames(v, rate @ own, T, ours, W, condition)
        if not self.constant:
            return
        torque = pin.rnea(model, data, q, v, a)
        by_q, by_v, _ = pin.computeRNEADerivatives(model, data, q, v, a)
        turning = np.array([slope @ own for slope, _ in slopes]).T.reshape(model.nv, nv)
        further = np.array([slope @ vd + x for slope, x in slopes]).T.reshape(model.nv, nv)
        pushed = np.array([slope.T @ torque for slope, _ in slopes]).T.reshape(nv, nv)
        by_q = pushed + T.T @ (by_q @ T + by_v @ turning + mass @ further)
        # (Ṫ v) by v is 2 Ṫ for a free joint, but for the part of the spin that T has.
        sped = self._rate_slopes(T, own)
        by_v = T.T @ (by_v @ T + mass @ sped)
        name = "inverse_dynamics_derivatives"
        yield name, ours[name], np.array([by_q, by_v]), 1.0
        # Those at the accelerations that `tau` gives, by the same formulas.
        found = W @ (tau - T.T @ (h + mass @ rate @ own))
        a = T @ found + rate @ own
        torque = pin.rnea(model, data, q, v, a)
        by_q, by_v_pin, _ = pin.computeRNEADerivatives(model, data, q, v, a)
        further = np.array([slope @ found + x for slope, x in slopes]).T.reshape(model.nv, nv)
        pushed = np.array([slope.T @ torque for slope, _ in slopes]).T.reshape(nv, nv)
        by_q = pushed + T.T @ (by_q @ T + by_v_pin @ turning + mass @ further)
        by_v = T.T @ (by_v_pin @ T + mass @ sped)
        name = "forward_dynamics_derivatives"
        expected = np.array([-W @ by_q @ B, -W @ by_v @ B])
        yield name, ours[name] @ B, expected, condition, float(np.abs(found).max(initial=0.0))

    def _rates(self, T: Array, own: Array) -> tuple[Array, list[tuple[Array, Array]]]:
        """Ṫ, and for each velocity the derivatives of T and of Ṫ v by a small motion along it, of
        a free root, whose velocity in its axes is Rᵀ v + c x ω.
        """
        nv = T.shape[1]
        none = np.zeros_like(T), np.zeros(T.shape[0])
        rate, slopes = np.zeros_like(T), [none] * nv
        if self.root:
            linear, spin, w = self._root(T, own)
            rate[:3, linear] = -_skew(w) @ T[:3, linear]
            for axis, j in zip(np.eye(3), spin, strict=True):
                slope, second = np.zeros_like(T), np.zeros(T.shape[0])
                slope[:3, linear] = -_skew(axis) @ T[:3, linear]
                second[:3] = -np.cross(w, slope[:3, linear] @ own[linear])
                slopes[j] = slope, second
        return rate, slopes

    def _rate_slopes(self, T: Array, own: Array) -> Array:
        """The derivatives of Ṫ v by v."""
        found = np.zeros_like(T)
        if self.root:
            linear, spin, w = self._root(T, own)
            found[:3, linear] = -_skew(w) @ T[:3, linear]
            found[:3, spin] = _skew(T[:3, linear] @ own[linear])
        return found

    def _root(self, T: Array, own: Array) -> tuple[list[int], list[int], Array]:
        """Of the root the indices of its velocity and spin, and the spin."""
        moving = [j for j in range(T.shape[1]) if np.any(T[:6, j])]
        linear = [j for j in moving if not np.any(T[3:6, j])]
        spin = [j for j in moving if j not in linear]
        return linear, spin, own[spin]

    def _momentum(
        self, q: Array, v: Array, T: Array, ours: dict[str, Array]
    ) -> Iterator[tuple[str, Array, Array, float]]:
        """Those of the centre of mass; Pinocchio leaves out what is fixed to the world."""
        model, data = self.pin, self.data
        centre, mass = pin.centerOfMass(model, data, q), pin.computeTotalMass(model)
        still = model.inertias[0]
        whole = mass + still.mass
        if whole == 0.0:
            return
        expected = (mass * centre + still.mass * still.lever) / whole
        yield "centre_of_mass", ours["centre_of_mass"], expected, 1.0
        J = pin.jacobianCenterOfMass(model, data, q) @ T * (mass / whole)
        yield "centre_of_mass_jacobian", ours["centre_of_mass_jacobian"], J, 1.0
        A = np.array(pin.computeCentroidalMap(model, data, q)) @ T
        A[3:] += _skew(centre - expected) @ A[:3]
        yield "centroidal_momentum_matrix", ours["centroidal_momentum_matrix"], A, 1.0

    def _regressor(
        self, q: Array, v: Array, a: Array, T: Array, ours: dict[str, Array]
    ) -> Iterator[tuple[str, Array, Array, float]]:
        model, data = self.pin, self.data
        theirs = T.T @ pin.computeJointTorqueRegressor(model, data, q, v, a)
        bodies = [body.name for body in self.model.bodies]
        for name, joint in self.joints.items():
            child = self.links.get(joint.find("child").get("link", ""))  # type: ignore[union-attr]
            if not model.existJointName(name) or child is None:
                continue
            i, k = model.getJointId(name), bodies.index(child)
            columns = [IN_SPACE.index(part) for part in ORDER]
            expected = theirs[:, 10 * (i - 1) : 10 * i]
            yield "regressor", ours["regressor"][:, k, columns], expected, 1.0

    def _frames(
        self, v: Array, turning: Array, T: Array, ours: dict[str, Array], W: Array, condition: float
    ) -> Iterator[tuple[str, Array, Array, float]]:
        model, data = self.pin, self.data
        for i, link in enumerate(self.points):
            k = model.getFrameId(f"{link} point", pin.OP_FRAME)
            yield "point_positions", ours["point_positions"][i], data.oMf[k].translation, 1.0
            for end, frame in FRAMES.items():
                J = pin.getFrameJacobian(model, data, k, frame)
                drift = pin.getFrameJacobianTimeVariation(model, data, k, frame) @ v + J @ turning
                yield f"frame_jacobians{end}", ours[f"frame_jacobians{end}"][i], J @ T, 1.0
                name = f"frame_bias_accelerations{end}"
                if self.constant:
                    yield name, ours[name][i], drift, 1.0
            J = pin.getFrameJacobian(model, data, k, pin.LOCAL_WORLD_ALIGNED) @ T
            mobility = J @ W @ J.T
            name = "operational_mobilities"
            yield name, ours[name][i], mobility, condition
            if i in self.mobile:
                sizes = np.sqrt(np.diag(mobility))
                worse = float(np.linalg.cond(mobility / np.outer(sizes, sizes)))
                if worse < 1e12:
                    inertia = np.linalg.inv(mobility)
                    name = "operational_inertias"
                    yield name, ours[name][self.mobile.index(i)], inertia, condition * worse


def _skew(a: Array) -> Array:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
