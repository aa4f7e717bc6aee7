"""Imported robots beside Pinocchio.

Damping and friction, which Pinocchio does not apply, are added to its torques. It takes the joints
that mimic others as free; its M and h are projected on what moves.
"""

import xml.etree.ElementTree as xml
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.linalg import norm
from peer_frames import dynamics_at, expected_frames, frames, stand_in

import eomgen
from eomgen.dynamics.assembly import assembled
from eomgen.scene.importers.names import identifiers

SMOOTH = 0.01
"""Speed within which Coulomb friction is smoothed, rad/s or m/s."""
Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Apart:
    """Differences at a state, in Pinocchio's order and frames.

    accelerations  the greatest, relative to the greatest acceleration
    frames         that of places and velocities of links, relative to the greatest
    states         that of q and v of Pinocchio, there and back
    """

    accelerations: float
    frames: float
    states: float


class Robot:
    """A robot in both programs."""

    def __init__(self, path: Path, floating: bool, *, generate: bool = False) -> None:
        """The module is one that is generated, or the recursion that it is recorded from."""
        imported = eomgen.import_robot(path, floating=floating)
        self.tables = imported.tables
        self.model = assembled(eomgen.check(self.tables))
        self.module = stand_in(self.model)
        if generate:
            self.module = eomgen.load(eomgen.generate(self.tables, route="aba", outputs=[]))
        self.to = imported.pinocchio(self.module)
        root = xml.parse(path).getroot()
        grounded = root.find("link[@name='world']") is not None
        base = (pin.JointModelFreeFlyer(),) if floating and not grounded else ()
        self.pin = pin.buildModelFromUrdf(str(path), *base)
        self.data = self.pin.createData()
        self.locked = dict(self.tables.get("locked", {}))
        self.joints = {
            joint.get("name", ""): joint
            for joint in root.findall("joint")
            if joint.get("type") in ("revolute", "continuous", "prismatic")
        }
        self.own = identifiers(self.joints, "joint")
        links = [link.get("name", "") for link in root.findall("link")]
        self.links = identifiers((name for name in links if name != "world"), "link")

    def difference(self, rng: np.random.Generator) -> Apart:
        """The differences at a random state, with random forces of motors."""
        names = [name for name in self.pin.names if name in self.joints]
        held = [name for name in names if self.own[name] in self.locked]
        free = [n for n in names if n not in held and self._mimic(n) is None]
        rows = {name: self._dependence(name, free) for name in names}
        x, rate, torque = rng.normal(size=(3, len(free)))

        q, v, load = pin.neutral(self.pin), np.zeros(self.pin.nv), np.zeros(self.pin.nv)
        columns = [np.zeros((self.pin.nv, len(free)))]
        for joint in self.pin.joints:
            if joint.nv in (3, 6):  # a planar or a free one
                part = slice(joint.idx_v, joint.idx_v + joint.nv)
                sizes = {3: (2, 2), 6: (3, 4)}[joint.nv]
                place, turn = (rng.normal(size=size) for size in sizes)
                q[joint.idx_q : joint.idx_q + joint.nq] = [*place, *(turn / norm(turn))]
                v[part] = rng.normal(size=joint.nv)
                columns.append(np.eye(self.pin.nv)[:, part])
        for name in names:
            joint, (row, offset) = self.pin.joints[self.pin.getJointId(name)], rows[name]
            angle, i = float(row @ x) + offset, joint.idx_v
            q[joint.idx_q : joint.idx_q + joint.nq] = (
                [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
            )
            v[i], columns[0][i] = float(row @ rate), row
            load[i] = self._friction(name, v[i])
            if name in free:
                load[i] += torque[free.index(name)]
        basis = np.hstack(columns)
        mass = pin.crba(self.pin, self.data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        h = pin.nonLinearEffects(self.pin, self.data, q, v)
        scaled = basis / np.sqrt(np.diag(basis.T @ mass @ basis))
        expected = scaled @ np.linalg.solve(scaled.T @ mass @ scaled, scaled.T @ (load - h))

        y = self.to.state(q, v)
        u = {f"{self.own[n]}_motor": float(x) for n, x in zip(free, torque, strict=True)}
        off = np.abs(self.to.acceleration(0.0, y, u) - expected).max() / np.abs(expected).max()
        back = [*(self.to.position(y) - q), *(self.to.velocity(y) - v)]
        return Apart(float(off), self._frames(q, v, y), float(np.abs(back).max()))

    def _frames(self, q: Array, v: Array, y: Array) -> float:
        """The difference of places and velocities of links."""
        count, module = len(self.model.coordinates), self.module
        own_q, own_v = y[:count], y[count:]
        if hasattr(module, "FOLLOWING"):
            own_q, own_v = module.coordinates(0.0, y), module.velocities(0.0, y)
        assert [c.name for c in self.model.coordinates] == [*self.to.convention.positions]
        d = dynamics_at(self.model, own_q.tolist(), own_v.tolist())
        pin.forwardKinematics(self.pin, self.data, q, v)
        pin.updateFramePlacements(self.pin, self.data)
        coms = {body["name"]: np.array(body["com"]) for body in self.tables["bodies"]}
        off, size = [0.0], [1.0]
        for link, body in self.links.items():
            if not self.pin.existFrame(link, pin.BODY):
                continue
            at = self.pin.getFrameId(link, pin.BODY)
            place = self.data.oMf[at]
            moving = pin.getFrameVelocity(self.pin, self.data, at, pin.LOCAL_WORLD_ALIGNED)
            arm = place.rotation @ coms[body]
            speed = moving.linear + np.cross(moving.angular, arm)
            expected = expected_frames(
                place.rotation, place.translation + arm, speed, moving.angular
            )
            for found, other in zip(frames(d, body), expected, strict=True):
                off.append(np.abs(found - other).max())
                size.append(np.abs(other).max())
        return max(off) / max(size)

    def _mimic(self, name: str) -> xml.Element | None:
        return self.joints[name].find("mimic")

    def _dependence(self, name: str, free: list[str]) -> tuple[Array, float]:
        """A coordinate as a linear function of those that are free."""
        row = np.zeros(len(free))
        own_name = self.own[name]
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
