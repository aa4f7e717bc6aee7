"""Pinocchio's articulated-body algorithm over CasADi's SX, as C code.

The wheel of Pinocchio has no `pinocchio.casadi`, so the recursion of its `aba` (R. Featherstone,
Rigid Body Dynamics Algorithms, 2008, section 7.3, in axes of the bodies) is written here over SX,
with the numbers of a model of Pinocchio. Constants fold, as they do there. CasADi writes the code.
"""

import ctypes
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from paired import COLUMNS

FLAGS = (("-O2",), ("-O3", "-march=native"))
LOOP = """
void columns(long count, const double *q, const double *v, const double *tau, double *a) {
    static double w[SPACE + 1];
    for (long j = 0; j < count; j++) {
        const double *arg[16] = {q + j * NQ, v + j * NV, tau + j * NV};
        double *res[16] = {a + j * NV};
        aba(arg, res, 0, w, 0);
    }
}
"""


def skew(x: Any) -> Any:
    import casadi as ca

    zero = ca.SX(1, 1)
    return ca.vertcat(
        ca.horzcat(zero, -x[2], x[1]),
        ca.horzcat(x[2], zero, -x[0]),
        ca.horzcat(-x[1], x[0], zero),
    )


def turned(q: Any) -> Any:
    """The rotation of a quaternion (x, y, z, w), as Pinocchio stores it."""
    import casadi as ca

    x = skew(q[:3])
    return ca.SX.eye(3) + 2 * q[3] * x + 2 * x @ x


def about(axis: int, angle: Any) -> Any:
    """The rotation about a coordinate axis."""
    import casadi as ca

    c, s = ca.cos(angle), ca.sin(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    made = ca.SX(3, 3)
    made[axis, axis], made[j, j], made[k, k], made[j, k], made[k, j] = 1, c, c, -s, s
    return made


def joint(model: Any, i: int, q: Any) -> tuple[Any, Any, Any]:
    """Of a joint: the rotation and the position of its child in its parent, and its axes (6, n)."""
    import casadi as ca

    kind, at = model.joints[i].shortname(), model.joints[i].idx_q
    place = model.jointPlacements[i]
    fixed, arm = ca.SX(ca.DM(place.rotation)), ca.SX(ca.DM(place.translation))
    fixed, arm = ca.sparsify(fixed), ca.sparsify(arm)
    if kind == "JointModelFreeFlyer":
        return fixed @ turned(q[at + 3 : at + 7]), arm + fixed @ q[at : at + 3], ca.SX.eye(6)
    axis = "XYZ".index(kind.removeprefix("JointModelR"))
    return fixed @ about(axis, q[at]), arm, ca.SX.eye(6)[:, 3 + axis]


def motion(rotation: Any, arm: Any) -> Any:
    """The transformation of motions (linear, angular) from the parent to the child."""
    import casadi as ca

    down = rotation.T
    return ca.vertcat(ca.horzcat(down, -down @ skew(arm)), ca.horzcat(ca.SX(3, 3), down))


def crossed(v: Any) -> Any:
    """The matrix of the cross product of motions."""
    import casadi as ca

    linear, angular = skew(v[:3]), skew(v[3:])
    return ca.vertcat(ca.horzcat(angular, linear), ca.horzcat(ca.SX(3, 3), angular))


def accelerations(model: Any) -> Any:
    """The algorithm as a function of CasADi: (q, v, tau) to accelerations."""
    import casadi as ca

    q, v, tau = (ca.SX.sym(n, k) for n, k in (("q", model.nq), ("v", model.nv), ("tau", model.nv)))
    count = model.njoints
    up, axes, rate, bias, body, force = ([None] * count for _ in range(6))
    rate[0] = ca.SX(6, 1)
    for i in range(1, count):
        at = slice(model.joints[i].idx_v, model.joints[i].idx_v + model.joints[i].nv)
        rotation, arm, axes[i] = joint(model, i, q)
        up[i] = motion(rotation, arm)
        own = axes[i] @ v[at]
        rate[i] = up[i] @ rate[model.parents[i]] + own
        bias[i] = crossed(rate[i]) @ own
        body[i] = ca.sparsify(ca.SX(ca.DM(model.inertias[i].matrix())))
        force[i] = -crossed(rate[i]).T @ (body[i] @ rate[i])
    solved: list[Any] = [None] * count
    for i in range(count - 1, 0, -1):
        at = slice(model.joints[i].idx_v, model.joints[i].idx_v + model.joints[i].nv)
        lever = body[i] @ axes[i]
        inverse = ca.inv(axes[i].T @ lever)
        rest = tau[at] - axes[i].T @ force[i]
        solved[i] = (at, lever, inverse, rest)
        parent = model.parents[i]
        if parent:
            seen = body[i] - lever @ inverse @ lever.T
            felt = force[i] + seen @ bias[i] + lever @ (inverse @ rest)
            body[parent] = body[parent] + up[i].T @ seen @ up[i]
            force[parent] = force[parent] + up[i].T @ felt
    moved: list[Any] = [None] * count
    moved[0] = -ca.sparsify(ca.SX(ca.DM(model.gravity.vector)))
    found: list[Any] = []
    for i in range(1, count):
        at, lever, inverse, rest = solved[i]
        before = up[i] @ moved[model.parents[i]] + bias[i]
        found.append(inverse @ (rest - lever.T @ before))
        moved[i] = before + axes[i] @ found[-1]
    return ca.Function("aba", [q, v, tau], [ca.vertcat(*found)])


def columns(
    model: Any, q: np.ndarray, v: np.ndarray, tau: np.ndarray
) -> tuple[list[Callable[[], None]], np.ndarray, float]:
    """Calls of its C code for columns of states, one for each of `FLAGS`; what they find; the time
    of the longest compilation.
    """
    import casadi as ca

    function = accelerations(model)
    generator = ca.CodeGenerator("aba.c", {"with_header": False})
    generator.add(function)
    space = f"#define SPACE {function.sz_w()}\n#define NQ {model.nq}\n#define NV {model.nv}\n"
    found, calls, longest = np.zeros((model.nv, COLUMNS), order="F"), [], 0.0
    given = [np.asfortranarray(array) for array in (q, v, tau)]
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "aba.c"
        source.write_text(generator.dump() + space + LOOP, "utf-8")
        for flags in FLAGS:
            made, start = Path(folder) / f"aba{flags[0]}.so", time.perf_counter()
            command = ["cc", *flags, "-fPIC", "-shared", str(source), "-o", str(made), "-lm"]
            subprocess.run(command, check=True)
            longest = max(longest, time.perf_counter() - start)
            call = ctypes.CDLL(str(made)).columns
            call.argtypes, call.restype = [ctypes.c_long, *[ctypes.c_void_p] * 4], None
            arguments = [array.ctypes.data for array in (*given, found)]
            calls.append(lambda c=call, a=arguments, kept=given: c(COLUMNS, *a))
    return calls, found, longest
