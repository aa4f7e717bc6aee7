"""Imported robots beside Pinocchio.

Damping and friction, which Pinocchio does not apply, are added to its torques. It takes the joints
that mimic others as free; its M and h are projected on what moves.
"""

import time
import xml.etree.ElementTree as xml
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import eomgen
from eomgen.scene.importers.names import identifiers

SMOOTH = 0.01
"""Speed within which Coulomb friction is smoothed, rad/s or m/s."""
Array = np.ndarray[Any, np.dtype[np.float64]]


class Robot:
    """A robot in both programs."""

    def __init__(self, path: Path, floating: bool, route: str | None = None) -> None:
        tables = eomgen.import_robot(path, floating=floating).tables
        begun = time.perf_counter()
        generated = eomgen.generate(tables, route=route, outputs=[])
        self.module = eomgen.load(generated)
        taken = (line.split()[0] for line in generated.explanation if line.endswith("<- taken"))
        self.route = next(taken, route)
        self.seconds = time.perf_counter() - begun
        base = (pin.JointModelFreeFlyer(),) if floating else ()
        self.pin = pin.buildModelFromUrdf(str(path), *base)
        self.data = self.pin.createData()
        count = len(self.module.POSITIONS)
        self.coordinates, self.velocities = self.module.STATES[:count], self.module.STATES[count:]
        self.locked = dict(tables.get("locked", {}))
        free = next((joint["child"] for joint in tables["joints"] if joint["type"] == "free"), "")
        self.base, self.com = free, np.zeros(3)
        if free:
            (self.com,) = (np.array(b["com"]) for b in tables["bodies"] if b["name"] == free)
        self.joints = {
            joint.get("name", ""): joint
            for joint in xml.parse(path).getroot().findall("joint")
            if joint.get("type") in ("revolute", "continuous", "prismatic")
        }

    def difference(self, rng: np.random.Generator) -> float:
        """The difference of accelerations at a random state, relative to the largest."""
        names = [name for name in self.pin.names if name in self.joints]
        held = [n for n, own in identifiers(self.joints, "joint").items() if own in self.locked]
        free = [n for n in names if n not in held and self._mimic(n) is None]
        rows = {name: self._dependence(name, free) for name in names}
        x, rate, torque = rng.normal(size=(3, len(free)))
        values = {n: float(row @ x) + offset for n, (row, offset) in rows.items()}
        rates = {n: float(row @ rate) for n, (row, _) in rows.items()}
        pose, twist = pin.SE3.Random(), rng.normal(size=6)
        pose.translation = rng.normal(size=3)

        q, v, load = pin.neutral(self.pin), np.zeros(self.pin.nv), np.zeros(self.pin.nv)
        basis = np.zeros((self.pin.nv, len(free) + 6 * bool(self.base)))
        if self.base:
            q[:3], q[3:7] = pose.translation, pin.Quaternion(pose.rotation).coeffs()
            v[:6], basis[:6, len(free) :] = twist, np.eye(6)
        for name in names:
            joint = self.pin.joints[self.pin.getJointId(name)]
            angle = values[name]
            q[joint.idx_q : joint.idx_q + joint.nq] = (
                [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
            )
            v[joint.idx_v], basis[joint.idx_v, : len(free)] = rates[name], rows[name][0]
            load[joint.idx_v] = self._friction(name, rates[name])
            if name in free:
                load[joint.idx_v] += torque[free.index(name)]
        mass = pin.crba(self.pin, self.data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        h = pin.nonLinearEffects(self.pin, self.data, q, v)
        found = np.linalg.solve(basis.T @ mass @ basis, basis.T @ (load - h))

        own_name = identifiers(self.joints, "joint")
        state = {own_name[n]: values[n] for n in names}
        state |= {f"{own_name[n]}_dot": rates[n] for n in names}
        changes = {n: rows[n][0] @ found[: len(free)] for n in names}
        wanted = {f"{own_name[n]}_dot": float(x) for n, x in changes.items()}
        if self.base:
            more, accelerations = self._base(pose, twist, found[-6:])
            state |= more
            wanted |= accelerations
        y = np.array([state[name] for name in self.module.STATES])
        u = {f"{own_name[n]}_motor": float(x) for n, x in zip(free, torque, strict=True)}
        own = self.module.derivative(0.0, y, None, u)[len(self.coordinates) :]
        expected = np.array([wanted[name] for name in self.velocities])
        return float(np.abs(own - expected).max() / np.abs(expected).max())

    def _base(self, pose: Any, twist: Array, change: Array) -> tuple[dict[str, float], ...]:
        """State and acceleration of the base: of its centre of mass, in the world."""
        turn, c, (v, w) = pose.rotation, self.com, np.split(twist, 2)
        a, alpha = np.split(change, 2)
        at = pose.translation + turn @ c
        speed = turn @ (v + np.cross(w, c))
        push = turn @ (a + np.cross(w, v) + np.cross(alpha, c) + np.cross(w, np.cross(w, c)))
        x, y, z, real = pin.Quaternion(turn).coeffs()
        state = dict(zip("xyz", at, strict=True)) | {"qw": real, "qx": x, "qy": y, "qz": z}
        rates = dict(zip(("x_dot", "y_dot", "z_dot"), speed, strict=True))
        spins = dict(zip(("wx", "wy", "wz"), w, strict=True))
        gains = dict(
            zip(("x_dot", "y_dot", "z_dot", "wx", "wy", "wz"), [*push, *alpha], strict=True)
        )
        return (
            {f"{self.base}_{key}": float(x) for key, x in (state | rates | spins).items()},
            {f"{self.base}_{key}": float(x) for key, x in gains.items()},
        )

    def _mimic(self, name: str) -> xml.Element | None:
        return self.joints[name].find("mimic")

    def _dependence(self, name: str, free: list[str]) -> tuple[Array, float]:
        """A coordinate as a linear function of those that are free."""
        row = np.zeros(len(free))
        own_name = identifiers(self.joints, "joint")[name]
        if own_name in self.locked:
            return row, self.locked[own_name]
        mimic = self._mimic(name)
        if mimic is None:
            row[free.index(name)] = 1.0
            return row, 0.0
        inner, offset = self._dependence(mimic.get("joint", ""), free)
        factor = float(mimic.get("multiplier", 1))
        return factor * inner, factor * offset + float(mimic.get("offset", 0))

    def _friction(self, name: str, rate: float) -> float:
        dynamics = self.joints[name].find("dynamics")
        damping, friction = (
            0.0 if dynamics is None else float(dynamics.get(key, 0))
            for key in ("damping", "friction")
        )
        return -damping * rate - friction * float(np.tanh(rate / SMOOTH))
