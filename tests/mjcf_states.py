"""Imported MJCF models beside MuJoCo: the same state for both, and their accelerations."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import eomgen
from eomgen.dynamics.assembly import assembled
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.errors import SceneError
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.importers import import_file
from eomgen.scene.importers.imported import Imported, Wishes
from eomgen.scene.importers.mjcf.compiled import compiled
from eomgen.scene.importers.mjcf.mechanism import Names
from eomgen.scene.importers.mjcf.robot import names_of
from eomgen.scene.reader import read_tables

Array = Any
FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
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

    def values(self, data: Any, rates: Array | None = None) -> dict[str, float]:
        """The state of the scene by name; of velocities their rates, if these are given."""
        mj, names, found = self.mj, self.names, dict[str, float]()
        speeds, accelerating = (data.qvel if rates is None else rates), rates is not None
        for j in range(mj.njnt):
            kind, q, v = mj.jnt_type[j], mj.jnt_qposadr[j], mj.jnt_dofadr[j]
            name, body = names.joints[j], mj.jnt_bodyid[j]
            if kind not in (FREE, BALL):
                found |= {name: data.qpos[q], f"{name}_dot": speeds[v]}
                continue
            spin, turn = v + 3 * (kind == FREE), q + 3 * (kind == FREE)
            whole = kind == FREE and j not in names.split
            prefix = names.bodies[body] if whole else name
            if kind == FREE:
                point = prefix if whole else names.between[body, j]
                place, pace = np.array(data.qpos[q : q + 3]), np.array(speeds[v : v + 3])
                if whole:
                    arm = data.xmat[body].reshape(3, 3) @ mj.body_ipos[body]
                    w = data.xmat[body].reshape(3, 3) @ data.qvel[spin : spin + 3]
                    turned = data.xmat[body].reshape(3, 3) @ speeds[spin : spin + 3]
                    pace = pace + np.cross(turned, arm)
                    if accelerating:
                        pace = pace + np.cross(w, np.cross(w, arm))
                    place = place + arm
                found |= {f"{point}_{x}": place[i] for i, x in enumerate("xyz")}
                found |= {f"{point}_{x}_dot": pace[i] for i, x in enumerate("xyz")}
            found |= {f"{prefix}_q{x}": data.qpos[turn + i] for i, x in enumerate("wxyz")}
            found |= {f"{prefix}_w{x}": speeds[spin + i] for i, x in enumerate("xyz")}
        return found

    def velocity_names(self) -> list[str]:
        """The name in the scene of each of MuJoCo's velocities."""
        mj, names, found = self.mj, self.names, list[str]()
        for j in range(mj.njnt):
            kind, name, body = mj.jnt_type[j], names.joints[j], mj.jnt_bodyid[j]
            if kind not in (FREE, BALL):
                found.append(f"{name}_dot")
                continue
            whole = kind == FREE and j not in names.split
            prefix = names.bodies[body] if whole else name
            if kind == FREE:
                point = prefix if whole else names.between[body, j]
                found += [f"{point}_{x}_dot" for x in "xyz"]
            found += [f"{prefix}_w{x}" for x in "xyz"]
        return found

    def forces(self, data: Any) -> list[float]:
        """The generalised forces, in the order of the scene's velocities."""
        mj, applied = self.mj, data.qfrc_applied.copy()
        for j in range(mj.njnt):
            v, body = mj.jnt_dofadr[j], mj.jnt_bodyid[j]
            if mj.jnt_type[j] == FREE and j not in self.names.split:
                turned = data.xmat[body].reshape(3, 3)
                moment = np.cross(turned @ mj.body_ipos[body], applied[v : v + 3])
                applied[v + 3 : v + 6] -= turned.T @ moment
        named = dict(zip(self.velocity_names(), applied, strict=True))
        return [named[c.name] for c in self.model.velocities]

    def inputs(self, ctrl: Array) -> dict[str, float]:
        """The inputs of the scene."""
        return dict(zip(self.names.inputs, ctrl, strict=True)) if self.driven else {}

    def accelerations(self, data: Any, route: str = "aba") -> Array:
        """v̇ of the scene at a state of MuJoCo, by the recursion of a route."""
        values, model = self.values(data), self.model
        q, v = ([values[c.name] for c in part] for part in (model.coordinates, model.velocities))
        given = Values(model.defaults, self.inputs(data.ctrl), q, v, self.activations(data.act))
        return np.array(
            Dynamics(model, given, FloatScalars(), "own").forward(route)(self.forces(data))
        )

    def activation_rates(self, data: Any) -> tuple[Array, Array]:
        """Rates of the scene's extra states, and MuJoCo's, in the same order."""
        values, model = self.values(data), self.model
        q, v = ([values[c.name] for c in part] for part in (model.coordinates, model.velocities))
        given = Values(model.defaults, self.inputs(data.ctrl), q, v, self.activations(data.act))
        dynamics = Dynamics(model, given, FloatScalars(), "own")
        rates = [rate for effect in model.effects for rate in effect.rates(dynamics)]
        return np.array(rates), np.array([*self.activations(data.act_dot).values()])

    def expected(self, data: Any) -> Array:
        """v̇ of MuJoCo, in the order of the scene's velocities."""
        values = self.values(data, data.qacc)
        return np.array([values[c.name] for c in self.model.velocities])

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
        values = self.values(data)
        q, v = ([values[c.name] for c in part] for part in self._state)
        x, u = [*self.activations(data.act).values()], self.inputs(data.ctrl)
        more = {"x": x} if x else {}
        return self.module.forward_dynamics(q, v, self.forces(data), 0.0, None, u, **more)

    @property
    def _state(self) -> tuple[Any, Any]:
        return self.model.coordinates, self.model.velocities

    def differences(self, count: int, *, module: bool = False) -> Array:
        """At random states, the greatest difference of accelerations relative to the greatest of
        them, and the greatest of single components relative to each; (count, 2).
        """
        rng, found = np.random.default_rng(0), list[tuple[float, float]]()
        for _ in range(count):
            data = self.in_mujoco(rng)
            expected = self.expected(data)
            off = np.abs((self.from_module if module else self.accelerations)(data) - expected)
            size = np.abs(expected)
            found.append((off.max() / size.max(), (off / size).max()))
        return np.array(found)

    def constrained(self, route: str, rng: np.random.Generator) -> "Constrained":
        """Accelerations under equality constraints, where these are met at the start."""
        model, mj = assembled(self.model), self.mj
        mj.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
        data, whole = mujoco.MjData(mj), np.zeros((mj.nv, mj.nv))
        data.qpos[:] = self._qpos(model)
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
        values = self.values(data)
        q, v = ([values[c.name] for c in part] for part in (model.coordinates, model.velocities))
        given = Values(model.defaults, self.inputs(data.ctrl), q, v, self.activations(data.act))
        dynamics = Dynamics(model, given, FloatScalars(), "own")
        found = dict(
            zip((c.name for c in model.velocities), dynamics.forward(route)(None), strict=True)
        )
        vd = self._rates(data, found)
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

    def _qpos(self, model: Model) -> Array:
        """MuJoCo's coordinates at the start of a model."""
        mj, names = self.mj, self.names
        named = dict(zip((c.name for c in model.coordinates), model.initial_q, strict=True))
        named |= dict(model.locked)
        qpos = mj.qpos0.copy()
        for j in range(mj.njnt):
            kind, at, name = mj.jnt_type[j], mj.jnt_qposadr[j], names.joints[j]
            if kind == BALL:
                qpos[at : at + 4] = [named[f"{name}_q{x}"] for x in "wxyz"]
            elif kind == FREE:
                body = mj.jnt_bodyid[j]
                turn = [named[f"{names.bodies[body]}_q{x}"] for x in "wxyz"]
                matrix = np.zeros(9)
                mujoco.mju_quat2Mat(matrix, np.array(turn))
                place = [named[f"{names.bodies[body]}_{x}"] for x in "xyz"]
                qpos[at : at + 3] = place - matrix.reshape(3, 3) @ mj.body_ipos[body]
                qpos[at + 3 : at + 7] = turn
            else:
                qpos[at] = named[name]
        return qpos

    def _rates(self, data: Any, found: dict[str, float]) -> Array:
        """v̇ of MuJoCo by that of the scene, without free joints that are split."""
        mj = self.mj
        vd = np.array([found.get(name, 0.0) for name in self.velocity_names()])
        for j in range(mj.njnt):
            if mj.jnt_type[j] == FREE:
                v, body = mj.jnt_dofadr[j], mj.jnt_bodyid[j]
                turned = data.xmat[body].reshape(3, 3)
                arm = turned @ mj.body_ipos[body]
                w, turning = turned @ data.qvel[v + 3 : v + 6], turned @ vd[v + 3 : v + 6]
                vd[v : v + 3] -= np.cross(turning, arm) + np.cross(w, np.cross(w, arm))
        return vd


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
