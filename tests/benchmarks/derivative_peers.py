"""Derivatives of forward dynamics in C beside Pinocchio's, and their error against 60 digits.

    pip install -e '.[bench]' && python tests/benchmarks/derivative_peers.py ROBOT.urdf [--rounds N]

Of a robot that moves freely: the operations of its own recursion, of derivatives of inverse
dynamics solved with the factors of M, and of forward dynamics along each of the directions; the
times of one state after another, in C on both sides, by turns, Pinocchio compiled against its
wheel; and the greatest error, relative to the greatest entry, against differences of forward
dynamics in 60 digits. Pinocchio computes M⁻¹, too.
"""

import argparse
import ctypes
import subprocess
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
from paired import compared, paired

import eomgen
from eomgen.codegen.backends import c
from eomgen.codegen.interface import interface_of
from eomgen.codegen.jacobians import _applied_slopes, _by_articulated_bodies, _by_factors
from eomgen.codegen.jacobians import _operations as operations
from eomgen.codegen.recording import Recording
from eomgen.dynamics.start.assembly import assembled
from eomgen.model.model import Model
from eomgen.native.functions import restricted
from eomgen.native.library import compiled_library
from eomgen.pipeline import compile_program
from eomgen.program.differentiate import tangent
from eomgen.program.program import Output, Program, cost, finish, interpret
from eomgen.program.tape import TIME, Stage
from eomgen.scalars.extended import Bits, sixty_digits

HERE = Path(__file__).parent
NAME = "forward_dynamics_derivatives"
STATES = 100
EACH = """
#include "checked.c"

void each(long count, const double *y, const double *k, const double *u, const double *tau,
          double *out) {{
    for (long j = 0; j < count; j++) {name}(0.0, y + j * {ny}, k, u, tau + j * {nv}, out);
}}
"""


def counts(model: Model) -> dict[str, int]:
    """The operations of each way, with those of the accelerations."""
    record = Recording(model, "aba")
    found = {
        "its own recursion": operations(record, *_by_articulated_bodies(record, record.vd)),
        "by inverse dynamics and factors": operations(record, *_by_factors(record, record.vd)),
    }
    _applied_slopes(record)
    seeds = {x.index: record.input(f"d{x.index}", Stage.INPUTS) for x in record.state}
    nodes = tuple(x.index for x in tangent(record.vd, seeds))
    program = finish(record.tape, {"": Output((len(nodes),), nodes)}, ())
    found["along directions, one after another"] = (
        2 * len(model.velocities) * cost(program, "")["total"]
    )
    return found


def exact(model: Model, y: np.ndarray, h: str = "1e-20") -> np.ndarray:
    """Central differences of forward dynamics in 60 digits, (2, nv, nv)."""
    record = Recording(model, "aba")
    nodes = tuple(x.index for x in record.vd)
    program = finish(record.tape, {"vd": Output((len(nodes),), nodes)}, ())
    names = [c.name for c in (*model.coordinates, *model.velocities)]
    nq, nv = len(model.coordinates), len(model.velocities)
    with sixty_digits():
        scalars = Bits()
        start, step = [scalars.number(float(x)) for x in y], scalars.number(float(h))
        fixed = {n: scalars.number(x) for n, x in model.defaults.items()}
        fixed |= {i.name: scalars.number(0.0) for i in model.inputs} | {TIME: scalars.number(0.0)}

        def rates(values: list[Any]) -> np.ndarray:
            given = fixed | dict(zip(names, values, strict=True))
            return np.array(interpret(program, "vd", given, scalars))

        def slope(change: dict[int, Any]) -> np.ndarray:
            ends = []
            for sign in (1, -1):
                values = list(start)
                for i, by in change.items():
                    values[i] = values[i] + sign * step * by
                ends.append(rates(values))
            return (ends[0] - ends[1]) / (step + step)

        changes: list[dict[int, Any]] = [{} for _ in range(nv)]
        for index in model.joint_indices:
            for i, j in index.plain:
                changes[j] = {i: 1}
            if index.quaternion:
                w, x, y_, z = (start[i] / 2 for i in index.quaternion)
                rows = ((-x, w, z, -y_), (-y_, -z, w, x), (-z, y_, -x, w))
                for j, row in zip(index.spin, rows, strict=True):
                    changes[j] = dict(zip(index.quaternion, row, strict=True))
        by_q = [slope(change) for change in changes]
        by_v = [slope({nq + j: 1}) for j in range(nv)]
        return np.array([np.array(by_q).T, np.array(by_v).T]).astype(float)


def ours(model: Model, y: np.ndarray, tau: np.ndarray) -> tuple[Any, np.ndarray, Program, float]:
    """A call of all states, where it puts the last matrices, the program, the compiler's time."""
    found = compile_program(replace(model, outputs=(NAME,)), jacobian=False)
    program, interface = restricted(found.system.program, interface_of(found.system), (NAME,))
    texts = dict(c.library(program, interface))
    function, ny, nv = f"{interface.name}_{NAME}", y.shape[1], tau.shape[1]
    texts["each.c"] = EACH.format(name=function, ny=ny, nv=nv)
    begun = time.perf_counter()
    made = compiled_library(f"{NAME} {time.time()}", lambda: texts, "each.c")
    seconds = time.perf_counter() - begun
    held = (ctypes.c_long * 4).in_dll(made, "sizes")[3]
    k, p = np.zeros(max(1, held)), np.array([*model.defaults.values()])
    pointer = ctypes.c_void_p
    made.constants_of(pointer(p.ctypes.data), pointer(k.ctypes.data))
    u, out = np.zeros(max(1, len(model.inputs))), np.zeros((2, nv, nv))
    given = [pointer(x.ctypes.data) for x in (y, k, u, tau, out)]
    count, kept = ctypes.c_long(len(y)), (p, k, u)
    return (lambda kept=kept: made.each(count, *given)), out, program, seconds


KINDS = ("JointModelRX", "JointModelRY", "JointModelRZ", "JointModelFreeFlyer")
"""The joints that `derivative_peers.cc` knows."""


def theirs(robot: Any, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> tuple[Any, np.ndarray]:
    """The same by Pinocchio, column by column."""
    prefix, folder = Path(pin.__file__).parents[4], Path(tempfile.mkdtemp())
    eigen = Path(ca.__file__).parent / "include/eigen3"
    command = ["c++", "-std=c++17", "-O3", "-DNDEBUG", "-fPIC", "-shared", "-w"]
    command += ["-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION", "-DBOOST_MPL_LIMIT_LIST_SIZE=30"]
    command += ["-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", f"-I{prefix / 'include'}", f"-I{eigen}"]
    command += [str(HERE / "derivative_peers.cc"), "-o", str(folder / "peer.so")]
    command += [f"-L{prefix / 'lib'}", "-lpinocchio_default"]
    subprocess.run([*command, f"-Wl,-rpath,{prefix / 'lib'}"], check=True)
    built = ctypes.CDLL(str(folder / "peer.so"))
    built.mechanism.restype = pointer = ctypes.c_void_p
    rows = []
    for i in range(1, robot.njoints):
        place, inertia = robot.jointPlacements[i], robot.inertias[i]
        row = [KINDS.index(robot.joints[i].shortname()), robot.parents[i], *place.rotation.ravel()]
        rows.append([*row, *place.translation, inertia.mass, *inertia.lever])
        rows[-1] += inertia.inertia.ravel().tolist()
    joints = np.array(rows, dtype=float)
    model = pointer(built.mechanism(len(rows), pointer(joints.ctypes.data)))
    out = np.zeros((2, v.shape[1], v.shape[1]))
    given = [pointer(x.ctypes.data) for x in (q, v, tau, out)]
    return (lambda kept=(q, v, tau): built.each(model, ctypes.c_long(len(q)), *given)), out


def main() -> None:
    """Print all of them."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("robot", type=Path)
    parser.add_argument("--rounds", type=int, default=25)
    given = parser.parse_args()
    imported = eomgen.import_robot(given.robot, floating=True)
    kept = [e for e in imported.tables["effects"] if e["type"] in ("gravity", "motor")]
    model = assembled(eomgen.check({**imported.tables, "effects": kept}))
    nq, nv = len(model.coordinates), len(model.velocities)
    for name, count in counts(model).items():
        print(f"{count:8} operations {name}", flush=True)
    peer = pin.buildModelFromUrdf(str(given.robot), pin.JointModelFreeFlyer())
    rng = np.random.default_rng(1)
    low, high = -np.ones(peer.nq), np.ones(peer.nq)
    q = np.array([pin.randomConfiguration(peer, low, high) for _ in range(STATES)])
    v, tau = rng.uniform(-1.0, 1.0, (2, STATES, peer.nv))
    y = rng.uniform(-1.0, 1.0, (STATES, nq + nv))
    for indices in map(list, model.quaternions):
        y[:, indices] /= np.linalg.norm(y[:, indices], axis=1)[:, None]
    call, out, program, seconds = ours(model, y, np.zeros((STATES, nv)))
    print(f"{cost(program, NAME)['total']:8} operations of the kernel, compiled in {seconds:.0f} s")
    call()
    expected = exact(model, y[-1])
    worst = np.abs(out - expected).max() / np.abs(expected).max()
    print(f"{worst:.1e} from 60 digits, relative to the greatest entry", flush=True)
    other, check = theirs(peer, q, v, tau)
    other()
    by_pinocchio = pin.computeABADerivatives(peer, peer.createData(), q[-1], v[-1], tau[-1])
    assert np.abs(check[0].T - by_pinocchio[0]).max() < 1e-9 * np.abs(check[0]).max()
    times = paired(given.rounds, call, other, warm=True)
    least = times.min(axis=0) / STATES * 1e6
    print(f"{least[0]:.1f} µs, Pinocchio {least[1]:.1f} µs: {compared(times[:, 0], times[:, 1])}")


if __name__ == "__main__":
    main()
