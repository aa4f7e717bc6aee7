"""Planar four-bar and slider-crank in C beside engines that close loops, as paired measurements.

    pip install -e '.[bench]' && python tests/benchmarks/loop_peers.py [--rounds N]

One derivative, of 2000 closed states one after another: the checked kernel of `eomgen.native`;
Pinocchio's `constraintDynamics` in C++, compiled here against its wheel and the headers of Eigen
that CasADi's wheel has; MuJoCo's `mj_forward` with an equality constraint, called from C; and C
code that CasADi makes of Lagrange's equations with multipliers, solved with its own symbolic
elimination. The mechanism is the same for all, and all accelerations are compared with closed
formulas. Pinocchio's pin has three rows, of which one is redundant in the plane, so it iterates;
MuJoCo's constraints are soft.

One step of the classical Runge-Kutta method: ours projects on positions and velocities; MuJoCo's
does not. Printed are least times, and their ratios with the quartiles of those of paired rounds.
"""

import argparse
import ctypes
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import mujoco
import numpy as np
import pinocchio as pin
from paired import COLUMNS, compared, paired, row
from peers import library, of_rows

sys.path.append(str(Path(__file__).parent.parent))

import planar_linkages as linkages

from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.native.accelerator import Accelerator
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem, load_module
from eomgen.scene.reader import parse_scene
from eomgen.store import generated_code

HERE = Path(__file__).parent
STEP, STEPS = 1e-3, 5000
PROXIMAL = 1e-8
"""Pinocchio's regularisation of redundant rows."""
MUJOCO = """
#include <mujoco/mujoco.h>
#include <string.h>

void columns(mjModel *m, mjData *d, long count, const double *q, const double *v, double *out) {
    for (long i = 0; i < count; i++) {
        memcpy(d->qpos, q + i * m->nq, m->nq * sizeof *q);
        memcpy(d->qvel, v + i * m->nv, m->nv * sizeof *v);
        mj_forward(m, d);
        memcpy(out + i * m->nv, d->qacc, m->nv * sizeof *out);
    }
}
"""
CASADI = """
void columns(long count, const double *q, const double *v, double *out) {
    static double space[SPACE + 1];
    static long long whole[WHOLE + 1];
    for (long i = 0; i < count; i++) {
        const double *given[] = { q + i * N, v + i * N };
        double *found[] = { out + i * N };
        rates(given, found, whole, space, 0);
    }
}
"""


@dataclass(frozen=True)
class Body:
    """A body whose joint slides along x or turns about z, at a place of its parent (0: the world).
    Its centre of mass and its end lie along x.
    """

    slides: bool
    parent: int
    place: tuple[float, float]
    mass: float
    centre: float
    inertia: float


@dataclass(frozen=True)
class Linkage:
    """A mechanism: the names of its coordinates, its bodies, and the two places of its last pin."""

    name: str
    scene: Callable[[float, float], str]
    formulas: Callable[[float, float], linkages.Motion]
    names: tuple[str, ...]
    bodies: tuple[Body, ...]
    pin: tuple[tuple[int, float], tuple[int, float]]


def four_bar() -> Linkage:
    (a, b, c), m, i = linkages.BARS, linkages.BAR_MASSES, linkages.BAR_INERTIAS
    bodies = (
        Body(False, 0, (0.0, 0.0), m[0], a / 2, i[0]),
        Body(False, 1, (a, 0.0), m[1], b / 2, i[1]),
        Body(False, 0, (linkages.GROUND, 0.0), m[2], c / 2, i[2]),
    )
    names = ("theta", "bend", "gamma")
    return Linkage(
        "four-bar", linkages.four_bar_scene, linkages.four_bar, names, bodies, ((2, b), (3, c))
    )


def slider_crank() -> Linkage:
    r, rod, m, i = linkages.CRANK, linkages.ROD, linkages.MASSES, linkages.INERTIAS
    bodies = (
        Body(False, 0, (0.0, 0.0), m[0], r / 2, i[0]),
        Body(False, 1, (r, 0.0), m[1], rod / 2, i[1]),
        Body(True, 0, (0.0, 0.0), m[2], 0.0, 0.01),
    )
    names, formulas = ("theta", "bend", "x"), linkages.slider_crank
    pins = ((2, rod), (3, 0.0))
    return Linkage("slider-crank", linkages.slider_crank_scene, formulas, names, bodies, pins)


def states(of: Linkage) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Closed positions, velocities and accelerations by formulas, a row each."""
    rng = np.random.default_rng(1)
    q, v, a = np.empty((3, COLUMNS, len(of.names)))
    for i in range(COLUMNS):
        rate = rng.uniform(-5.0, 5.0)
        motion = of.formulas(rng.uniform(-3.0, 3.0), rate)
        q[i], v[i], a[i] = motion.q, motion.by_angle * rate, motion.accelerations(rate)
    return q, v, a


Call = tuple[Callable[[], None], Callable[[], np.ndarray]]
"""A call for all states, and what it has found: the accelerations, a row each."""


def ours(of: Linkage, q: np.ndarray, v: np.ndarray) -> tuple[Call, Any, Any]:
    """And the model and its module. Its state may have fewer coordinates than the mechanism."""
    model = assembled(elaborate(parse_scene(of.scene(1.0, 2.0))))
    module = load_module(generated_code(model).module, model.name)
    known = dict(zip(of.names, q.T, strict=True))
    known |= {f"{name}_dot": rates for name, rates in zip(of.names, v.T, strict=True)}
    y = np.array([known[name] for name in module.STATES])
    call, rates = of_rows(module, library(model, False)[0], y, "each")

    def found() -> np.ndarray:
        given = dict(zip(module.STATES, rates.T, strict=True))
        nan = np.full(len(rates), np.nan)
        return np.array([given.get(f"{name}_dot", nan) for name in of.names]).T

    return (call, found), model, module


def by_pinocchio(of: Linkage, q: np.ndarray, v: np.ndarray, folder: Path) -> Call:
    """Raises `CalledProcessError` if it cannot be compiled."""
    prefix, made = Path(pin.__file__).parents[4], folder / "pinocchio.so"
    if not made.exists():
        eigen = Path(ca.__file__).parent / "include/eigen3"
        libraries = prefix / "lib"
        limits = ["-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS"]
        flags = ["-std=c++17", "-O3", "-DNDEBUG", "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION"]
        places = [f"-I{prefix / 'include'}", f"-I{eigen}", f"-L{libraries}"]
        last = ["-lpinocchio_default", f"-Wl,-rpath,{libraries}"]
        whole = ["c++", *flags, *limits, "-fPIC", "-shared", "-w", *places]
        whole += [str(HERE / "loop_peers.cc"), "-o", str(made), *last]
        subprocess.run(whole, check=True)
    built = ctypes.CDLL(str(made))
    built.mechanism.restype = ctypes.c_void_p
    bodies = np.array(
        [[b.slides, b.parent, *b.place, b.mass, b.centre, b.inertia] for b in of.bodies]
    )
    loop = np.array([x for end in of.pin for x in end], float)
    pointer, out, iterations = ctypes.c_void_p, np.empty_like(q), ctypes.c_long()
    model = pointer(built.mechanism(len(bodies), pointer(bodies.ctypes.data),
                                    pointer(loop.ctypes.data)))  # fmt: skip
    call = built.columns
    call.argtypes = [pointer, ctypes.c_long, *[pointer] * 3, ctypes.c_double, ctypes.c_int, pointer]
    arguments = (model, COLUMNS, q.ctypes.data, v.ctypes.data, out.ctypes.data, PROXIMAL, 50)

    def compute(kept: Any = (q, v, bodies, loop)) -> None:
        call(*arguments, ctypes.addressof(iterations))

    return compute, lambda: out


def for_mujoco(of: Linkage) -> str:
    """The mechanism as MuJoCo reads it."""
    inside: dict[int, str] = {0: ""}
    pins = dict(of.pin)
    for i in range(len(of.bodies), 0, -1):
        b = of.bodies[i - 1]
        kind = "slide" if b.slides else "hinge"
        axis = "1 0 0" if b.slides else "0 0 1"
        site = f'<site name="p{i}" pos="{pins[i]} 0 0"/>' if i in pins else ""
        text = (
            f'<body pos="{b.place[0]} {b.place[1]} 0"><joint type="{kind}" axis="{axis}"/>'
            f'<inertial pos="{b.centre} 0 0" mass="{b.mass}" '
            f'diaginertia="{b.inertia} {b.inertia} {b.inertia}"/>{site}{inside.get(i, "")}</body>'
        )
        inside[b.parent] = text + inside.get(b.parent, "")
    (one, _), (two, _) = of.pin
    return (
        f'<mujoco><option gravity="0 -{linkages.G} 0" integrator="RK4" timestep="{STEP}">'
        '<flag contact="disable"/></option><compiler boundmass="0" boundinertia="0"/>'
        f"<worldbody>{inside[0]}</worldbody>"
        f'<equality><connect site1="p{one}" site2="p{two}"/></equality></mujoco>'
    )


def by_mujoco(of: Linkage, q: np.ndarray, v: np.ndarray, folder: Path) -> tuple[Call, Any]:
    """And a call that makes steps."""
    place, made = Path(mujoco.__file__).parent, folder / "mujoco.so"
    if not made.exists():
        (folder / "mujoco.c").write_text(MUJOCO, "utf-8")
        (shared,) = place.glob("libmujoco.so.*")
        command = ["cc", "-O2", "-fPIC", "-shared", f"-I{place / 'include'}"]
        command += [str(folder / "mujoco.c"), "-o", str(made), str(shared)]
        subprocess.run([*command, f"-Wl,-rpath,{place}"], check=True)
    model = mujoco.MjModel.from_xml_string(for_mujoco(of))
    data, out = mujoco.MjData(model), np.empty_like(q)
    call, pointer = ctypes.CDLL(str(made)).columns, ctypes.c_void_p
    call.argtypes = [pointer, pointer, ctypes.c_long, *[pointer] * 3]
    given = (model._address, data._address, COLUMNS, q.ctypes.data, v.ctypes.data, out.ctypes.data)

    def compute(kept: Any = (q, v)) -> None:
        call(*given)

    def steps() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = q[0], v[0]
        mujoco.mj_step(model, data, nstep=STEPS)

    return (compute, lambda: out), steps


def by_casadi(of: Linkage, q: np.ndarray, v: np.ndarray, folder: Path) -> Call:
    """M v̇ - Jᵀ λ = F - h and J v̇ = c, by their symbols."""
    count = len(of.names)
    at, rate = ca.SX.sym("q", count), ca.SX.sym("v", count)
    origins, angles = [ca.SX(2, 1)], [ca.SX(1, 1)]
    energy = potential = ca.SX(0)

    def beyond(i: int, length: Any) -> Any:
        """The place on the x axis of a body."""
        return origins[i] + length * ca.vertcat(ca.cos(angles[i]), ca.sin(angles[i]))

    for i, body in enumerate(of.bodies):
        angles.append(angles[body.parent] + (0 if body.slides else at[i]))
        along = body.place[0] + (at[i] if body.slides else 0)
        origins.append(beyond(body.parent, along))
        centre = beyond(i + 1, body.centre)
        speed, turn = ca.jtimes(centre, at, rate), ca.jtimes(angles[-1], at, rate)
        energy += (body.mass * ca.dot(speed, speed) + body.inertia * turn**2) / 2
        potential += body.mass * linkages.G * centre[1]
    (one, first), (two, second) = of.pin
    gap = beyond(one, first) - beyond(two, second)
    momentum = ca.gradient(energy, rate)
    mass, rows = ca.jacobian(momentum, rate), ca.jacobian(gap, at)
    force = ca.gradient(energy, at) - ca.gradient(potential, at) - ca.jtimes(momentum, at, rate)
    beside = -ca.jtimes(rows @ rate, at, rate)
    matrix = ca.blockcat([[mass, rows.T], [rows, ca.SX(2, 2)]])
    found = ca.solve(matrix, ca.vertcat(force, beside))[:count]
    function = ca.Function("rates", [at, rate], [found])
    generator = ca.CodeGenerator("rates.c", {"with_header": False})
    generator.add(function)
    source, made = folder / "rates.c", folder / f"rates_{of.name}.so"
    space = (
        f"#define SPACE {function.sz_w()}\n#define WHOLE {function.sz_iw()}\n#define N {count}\n"
    )
    source.write_text(generator.dump() + space + CASADI, "utf-8")
    command = ["cc", "-O3", "-march=native", "-fPIC", "-shared", str(source), "-o", str(made)]
    subprocess.run([*command, "-lm"], check=True)
    call, out = ctypes.CDLL(str(made)).columns, np.empty_like(q)
    call.argtypes = [ctypes.c_long, *[ctypes.c_void_p] * 3]
    given = (COLUMNS, q.ctypes.data, v.ctypes.data, out.ctypes.data)

    def compute(kept: Any = (q, v)) -> None:
        call(*given)

    return compute, lambda: out


def stepping(model: Any, module: Any) -> Callable[[], None]:
    """A run in compiled code from the first step on."""
    accelerator = Accelerator(model, module, None, None)
    accelerator.compile()
    problem = accelerator.of(as_problem(module))

    def steps() -> None:
        integrate(problem, "rk4", STEP * STEPS, dt=STEP, samples=2, unstable=True)

    return steps


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=30)
    rounds = parser.parse_args().rounds
    peers = ("Pinocchio", "MuJoCo", "CasADi")
    derivatives, steps = [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for of in (four_bar(), slider_crank()):
            q, v, true = states(of)
            own, model, module = ours(of, q, v)
            soft, theirs = by_mujoco(of, q, v, folder)
            hard, written = by_pinocchio(of, q, v, folder), by_casadi(of, q, v, folder)
            calls = (own, hard, soft, written)
            times = paired(rounds, *(call for call, _ in calls), warm=True)
            size = np.abs(true).max()
            off = [float(np.nanmax(np.abs(found() - true))) / size for _, found in calls]
            least = [f"{x:.3g}" for x in times.min(axis=0) / COLUMNS * 1e6]
            ratios = [compared(times[:, 0], times[:, k]) for k in (1, 2, 3)]
            operations = module.COST["derivative"]["total"]
            derivatives.append((of.name, operations, *least, *ratios, *(f"{x:.0e}" for x in off)))
            times = paired(max(5, rounds // 3), stepping(model, module), theirs)
            least = [f"{x:.3g}" for x in times.min(axis=0) / STEPS * 1e6]
            steps.append((of.name, *least, compared(times[:, 0], times[:, 1])))
    row("mechanism", "operations", "ours, µs", *(f"{peer}, µs" for peer in peers),
        *(f"{peer} / ours" for peer in peers), "ours off by", *peers)  # fmt: skip
    row(*["---"] * 13)
    for line in derivatives:
        row(*line)
    print()
    row("mechanism", "step of rk4, µs", "MuJoCo, µs", "MuJoCo / ours")
    row(*["---"] * 4)
    for line in steps:
        row(*line)


if __name__ == "__main__":
    main()
