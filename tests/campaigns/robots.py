"""Robot files against other programs: accelerations of the imported scene at random states.

    python tests/campaigns/robots.py urdf [--only TEXT] [--states 20] [--base fixed|floating|both]

prints for each URDF of the package `example-robot-data` its freedoms, the operations of a call, the
time to generate its module, and the largest difference of accelerations from Pinocchio's, relative
to the largest of the state. What is not supported has its message instead.

Torques are random. Damping and friction, which Pinocchio does not apply, are added to them here.
Pinocchio takes the joints that mimic others as free; M and h are projected on what moves.
"""

import argparse
import time
import xml.etree.ElementTree as xml
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import eomgen

BOUND = 1e-10
SMOOTH = 0.01
"""Speed within which Coulomb friction is smoothed, rad/s or m/s."""
Array = np.ndarray[Any, np.dtype[np.float64]]


def robots() -> Iterator[Path]:
    """The URDF files of example-robot-data."""
    package = next(p for p in Path(pin.__file__).parents if p.name == "cmeel.prefix")
    yield from sorted((package / "share/example-robot-data/robots").glob("**/*.urdf"))


class Robot:
    """A robot in both programs."""

    def __init__(self, path: Path, floating: bool) -> None:
        tables = eomgen.import_robot(path, floating=floating).tables
        begun = time.perf_counter()
        self.module = eomgen.load(eomgen.generate(tables, outputs=[]))
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
        free = [n for n in names if n not in self.locked and self._mimic(n) is None]
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

        state = dict(values) | {f"{n}_dot": rates[n] for n in names}
        wanted = {f"{n}_dot": float(rows[n][0] @ found[: len(free)]) for n in names}
        if self.base:
            more, accelerations = self._base(pose, twist, found[-6:])
            state |= more
            wanted |= accelerations
        y = np.array([state[name] for name in self.module.STATES])
        u = {f"{n}_motor": float(x) for n, x in zip(free, torque, strict=True)}
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
        if name in self.locked:
            return row, self.locked[name]
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


def urdf(given: argparse.Namespace) -> int:
    """Compare all robots; return how many differ by more than the bound."""
    wrong, worst, count = 0, 0.0, 0
    bases = {"both": (False, True)}.get(given.base, (given.base == "floating",))
    for path in robots():
        for floating in bases if given.only in str(path) else ():
            if floating and '<link name="world"' in path.read_text("utf-8"):
                continue  # Pinocchio would let the world move
            label = f"{path.stem:32} {'floating' if floating else 'fixed':8}"
            try:
                robot = Robot(path, floating)
            except eomgen.EomgenError as error:
                print(f"{label} {' / '.join(error.lines)}", flush=True)
                continue
            rng = np.random.default_rng(23)
            pin.seed(23)
            found = max(robot.difference(rng) for _ in range(given.states))
            wrong, worst, count = wrong + (not found < BOUND), max(worst, found), count + 1
            total = robot.module.COST["derivative"]["total"]
            print(
                f"{label} {len(robot.velocities):3} velocities {total:6} operations "
                f"{robot.seconds:6.1f} s  {found:.1e}{'' if found < BOUND else ' !'}",
                flush=True,
            )
    print(f"{count} compared, {wrong} beyond {BOUND:g}, worst {worst:.1e}")
    return wrong


def main() -> int:
    """Run one of the comparisons."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=("urdf",))
    parser.add_argument("--only", default="", help="part of a path")
    parser.add_argument("--states", type=int, default=20)
    parser.add_argument("--base", choices=("fixed", "floating", "both"), default="both")
    given = parser.parse_args()
    return {"urdf": urdf}[given.what](given)


if __name__ == "__main__":
    raise SystemExit(bool(main()))
