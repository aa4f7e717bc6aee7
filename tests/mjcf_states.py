"""Imported MJCF models beside MuJoCo: the same state for both, and their accelerations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
from peer_frames import dynamics_at, expected_frames, frames, stand_in

import eomgen
from eomgen.base.errors import SceneError
from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.scene.importers import import_file
from eomgen.scene.importers.conventions import convention
from eomgen.scene.importers.conversion import Conversion, conversion
from eomgen.scene.importers.imported import Imported, Wishes
from eomgen.scene.importers.mjcf.compiled import compiled
from eomgen.scene.importers.mjcf.mechanism import Names
from eomgen.scene.importers.mjcf.robot import names_of
from eomgen.scene.reader import read_tables

Array = Any
FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
BODY = mujoco.mjtObj.mjOBJ_XBODY
OFF = ("CONTACT", "LIMIT", "FRICTIONLOSS", "EQUALITY")


@dataclass(frozen=True)
class Comparison:
    """A file's scene and its model in MuJoCo, with what the scene lacks switched off in it."""

    imported: Imported
    names: Names
    mj: Any
    tables: dict[str, Any]
    driven: bool

    @staticmethod
    def of(path: Path, *, equalities: bool = False) -> "Comparison":
        """The comparison of a file, with or without its equality constraints."""
        imported = import_file(path, Wishes(allowed=tuple(path.parents)))
        mj = mujoco.MjModel.from_xml_path(str(path))
        for name in OFF:
            mj.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")
        mj.opt.density = mj.opt.viscosity = 0.0
        mj.tendon_armature[:] = 0.0
        mj.jnt_actgravcomp[:] = 0  # gravity compensation is then no actuation
        tables = dict(imported.tables)
        driven = not any(r.startswith("left out: actuators") for r in imported.remarks)
        effects = [e for e in tables["effects"] if e["type"] != "joint_friction"]
        if not driven:
            mj.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
            effects = [e for e in effects if "_drive" not in e.get("name", "")]
            tables.pop("inputs", None)
            tables["definitions"] = {
                k: v for k, v in tables.get("definitions", {}).items() if k.endswith("_tension")
            }
        tables["effects"] = effects
        tables.pop("parameters", None)
        if not equalities:
            tables.pop("constraints", None)
            tables.pop("locked", None)
            tables["joints"] = [j for j in tables["joints"] if not j.get("loop")]
        return Comparison(imported, names_of(compiled(path))[0], mj, tables, driven)

    @property
    def has_constraints(self) -> bool:
        """Whether the scene has constraints; locked coordinates are none."""
        loops = any(joint.get("loop") for joint in self.tables["joints"])
        return loops or bool(self.tables.get("constraints"))

    @property
    def nv(self) -> int:
        """The number of velocities."""
        return int(self.mj.nv)

    @cached_property
    def model(self) -> Model:
        """The model of the scene."""
        return elaborate(read_tables(self.tables))

    def random_state(self, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        """Coordinates, velocities and controls of MuJoCo."""
        qpos = self.mj.qpos0 + rng.uniform(-1.0, 1.0, self.mj.nq)
        for j in range(self.mj.njnt):
            first = self.mj.jnt_qposadr[j] + 3 * (self.mj.jnt_type[j] == FREE)
            if self.mj.jnt_type[j] in (FREE, BALL):
                part = rng.normal(size=4)
                qpos[first : first + 4] = part / np.linalg.norm(part)
        return qpos, rng.normal(size=self.mj.nv), rng.uniform(-0.9, 0.9, self.mj.nu)

    def in_mujoco(self, rng: np.random.Generator) -> Any:
        """MuJoCo's data after forward dynamics at a random state, with generalised forces that
        alone would give accelerations of order 1.
        """
        data, whole = mujoco.MjData(self.mj), np.zeros((self.nv, self.nv))
        data.qpos[:], data.qvel[:], data.ctrl[:] = self.random_state(rng)
        data.act[:] = rng.uniform(-0.9, 0.9, self.mj.na)
        mujoco.mj_forward(self.mj, data)
        mujoco.mj_fullM(self.mj, data, whole)
        if np.linalg.cond(whole / np.sqrt(np.outer(np.diag(whole), np.diag(whole)))) > 1e12:
            raise SceneError("the mass matrix is singular")
        data.qfrc_applied[:] = rng.normal(size=self.nv) * np.diag(whole)
        mujoco.mj_forward(self.mj, data)
        return data

    @cached_property
    def conversion(self) -> Conversion:
        """States of the scene as MuJoCo's."""
        joints = self.imported.convention.joints
        held = self.tables.get("locked", {})
        return conversion(convention("MuJoCo", joints, held), stand_in(self.model))

    def at(self, data: Any, model: Model | None = None) -> Dynamics:
        """The scene at MuJoCo's state."""
        model, act = model or self.model, self.activations(data.act)
        y = self.conversion.state(data.qpos, data.qvel, **act)
        q, v, _ = np.split(y, np.cumsum((len(model.coordinates), len(model.velocities))))
        return dynamics_at(model, q.tolist(), v.tolist(), self.inputs(data.ctrl), act)

    def forces(self, data: Any) -> list[float]:
        """The generalised forces, in the order of the scene's velocities: with v = B w of MuJoCo's
        velocities and the scene's, Bᵀ of MuJoCo's.
        """
        y, count = self.conversion.state(data.qpos, data.qvel), len(self.model.velocities)
        states, first = np.tile(y[:, None], count), len(self.model.coordinates)
        states[first : first + count] = np.eye(count)
        return list(self.conversion.velocity(states).T @ data.qfrc_applied)

    def rates(self, data: Any, vd: Sequence[float]) -> Array:
        """v̇ of MuJoCo by that of the scene."""
        y, first = self.conversion.state(data.qpos, data.qvel), len(self.model.coordinates)
        rates = np.zeros(len(y))
        rates[first : first + len(vd)] = vd
        module = SimpleNamespace(**{**vars(stand_in(self.model)), "derivative": lambda *_: rates})
        return replace(self.conversion, module=module).acceleration(0.0, y)

    def inputs(self, ctrl: Array) -> dict[str, float]:
        """The inputs of the scene."""
        return dict(zip(self.names.inputs, ctrl, strict=True)) if self.driven else {}

    def accelerations(self, data: Any, route: str = "aba") -> Array:
        """MuJoCo's v̇ by that of the scene."""
        return self.rates(data, self.at(data).forward(route)(self.forces(data)))

    def frames_apart(self, data: Any) -> float:
        """The greatest difference of places and velocities of bodies, relative to the greatest."""
        d, off, size = self.at(data), [0.0], [1.0]
        for k in range(1, self.mj.nbody):
            moving = np.zeros(6)
            mujoco.mj_objectVelocity(self.mj, data, BODY, k, moving, 0)
            turn, arm = data.xmat[k].reshape(3, 3), data.xipos[k] - data.xpos[k]
            speed = moving[3:] + np.cross(moving[:3], arm)
            expected = expected_frames(turn, data.xipos[k], speed, moving[:3])
            for own, other in zip(frames(d, self.names.bodies[k]), expected, strict=True):
                off.append(np.abs(own - other).max())
                size.append(np.abs(other).max())
        return max(off) / max(size)

    def activation_rates(self, data: Any) -> tuple[Array, Array]:
        """Rates of the scene's extra states, and MuJoCo's, in the same order."""
        dynamics = self.at(data)
        rates = [rate for effect in self.model.effects for rate in effect.rates(dynamics)]
        return np.array(rates), np.array([*self.activations(data.act_dot).values()])

    def activations(self, act: Array) -> dict[str, float]:
        """The extra states of the scene, by MuJoCo's activations."""
        named = {
            f"{name}_activation": act[first]
            for name, first in zip(self.names.inputs, self.mj.actuator_actadr, strict=True)
            if first >= 0
        }
        return {state.name: named[state.name] for state in self.model.extra}

    @cached_property
    def module(self) -> Any:
        """The generated module, by articulated bodies."""
        tables = {**self.tables, "outputs": ["forward_dynamics"], "route": "aba"}
        return eomgen.load(eomgen.generate(tables))

    def from_module(self, data: Any) -> Array:
        """v̇ of the generated module."""
        x, u = self.activations(data.act), self.inputs(data.ctrl)
        y = self.conversion.state(data.qpos, data.qvel)
        q, v, _ = np.split(y, np.cumsum((len(self.model.coordinates), len(self.model.velocities))))
        more = {"x": [*x.values()]} if x else {}
        forces = self.forces(data)
        vd = self.module.forward_dynamics(q, v, forces, 0.0, None, u, **more)
        return self.rates(data, vd)

    def differences(self, count: int, *, module: bool = False) -> Array:
        """At random states, the greatest difference of accelerations relative to the greatest of
        them, and the greatest of single components relative to each; the same of places and
        velocities of bodies, and of MuJoCo's state there and back; (count, 4).
        """
        rng, found = np.random.default_rng(0), list[tuple[float, ...]]()
        for _ in range(count):
            data, to = self.in_mujoco(rng), self.conversion
            expected = data.qacc
            off = np.abs((self.from_module if module else self.accelerations)(data) - expected)
            size = np.abs(expected)
            y = to.state(data.qpos, data.qvel)
            back = np.abs([*(to.position(y) - self.unit(data.qpos)), *(to.velocity(y) - data.qvel)])
            apart = self.frames_apart(data)
            found.append((off.max() / size.max(), (off / size).max(), apart, back.max()))
        return np.array(found)

    def unit(self, qpos: Array) -> Array:
        """MuJoCo's coordinates with quaternions of length 1."""
        found = qpos.copy()
        mujoco.mj_normalizeQuat(self.mj, found)
        return found

    def constrained(self, route: str, rng: np.random.Generator) -> "Constrained":
        """Accelerations under equality constraints, where these are met at the start."""
        model, mj = assembled(self.model), self.mj
        mj.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
        data, whole = mujoco.MjData(mj), np.zeros((mj.nv, mj.nv))
        data.qpos[:] = self.conversion.position(stand_in(model).initial_state())
        mujoco.mj_forward(mj, data)
        residual = np.abs(data.efc_pos).max()
        rows = np.zeros((data.nefc, mj.nv))
        if mujoco.mj_isSparse(mj):
            mujoco.mju_sparse2dense(
                rows, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
            )
        else:
            rows[:] = data.efc_J.reshape(-1, mj.nv)
        free = np.linalg.svd(rows)[2][np.linalg.matrix_rank(rows, tol=1e-8) :]
        data.qvel[:] = free.T @ rng.normal(size=len(free))
        mujoco.mj_forward(mj, data)
        mujoco.mj_fullM(mj, data, whole)
        vd = self.rates(data, self.at(data, model).forward(route)(None))
        left = whole @ vd - data.qfrc_smooth
        pushed = rows.T @ np.linalg.lstsq(rows.T, left, rcond=1e-9)[0]
        # Along a motion with this acceleration the rows stay met, but for the third power of time.
        step, moved = 1e-4, mujoco.MjData(mj)
        moved.qpos[:] = data.qpos
        mujoco.mj_integratePos(mj, moved.qpos, data.qvel * step + vd * step**2 / 2, 1.0)
        mujoco.mj_forward(mj, moved)
        return Constrained(
            np.abs(left).max(),
            np.abs(left - pushed).max(),
            residual,
            np.abs(moved.efc_pos).max() / step**3,
        )


@dataclass(frozen=True)
class Constrained:
    """How far accelerations are from what they must be under constraints.

    force     greatest component of the force M v̇ - f of the constraints
    apart     what of it is no combination of MuJoCo's rows
    residual  greatest residual at the start
    growth    greatest residual after a small time, over its third power
    """

    force: float
    apart: float
    residual: float
    growth: float
