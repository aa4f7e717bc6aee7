"""Whole runs beside general engines and SciPy: chains of equal rods to given true errors."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import sympy as sp
from paired import chain_of_pinocchio, paired, row, spread
from scipy.integrate import DOP853

from eomgen.derivation.handout.closed import derive
from eomgen.model.model import Model

Method = Callable[[float], np.ndarray]
"""The state [q, v] at the end of a motion, for a tolerance or the length of a step."""
TOLERANCES = tuple(10.0**-k for k in np.arange(4, 13.6, 0.5))
STEPS = tuple(0.01 * 2.0**-k for k in range(13))
ERRORS = (1e-6, 1e-9)
ROUNDS = 5


def rods(count: int, mass: float, half: float, inertia: float) -> str:
    """A planar chain of rods for MuJoCo, pinned to the world."""
    body = (
        '<body pos="{at} 0 0"><joint type="hinge" axis="0 0 1"/><inertial pos="{half} 0 0" '
        'mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>'
    )
    bodies = "".join(
        body.format(at=2 * half if i else 0, half=half, mass=mass, inertia=inertia)
        for i in range(count)
    )
    return (
        '<mujoco><option gravity="0 -9.81 0" integrator="RK4"/>'
        '<compiler boundmass="0" boundinertia="0"/>'
        f"<worldbody>{bodies}{'</body>' * count}</worldbody></mujoco>"
    )


def by_mujoco(text: str, start: np.ndarray, t_end: float) -> Method:
    """MuJoCo's Runge-Kutta method of order 4, all steps in one call."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)

    def end(dt: float) -> np.ndarray:
        steps = round(t_end / dt)
        model.opt.timestep = t_end / steps
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = np.split(start, 2)
        mujoco.mj_step(model, data, nstep=steps)
        return np.concatenate((data.qpos, data.qvel))

    return end


def by_scipy(derivative: Callable[[float, Any], Any], start: np.ndarray, t_end: float) -> Method:
    """SciPy's DOP853 over a derivative."""

    def end(tolerance: float) -> np.ndarray:
        bounds = {"rtol": max(tolerance, 2.3e-14), "atol": 0.1 * tolerance}
        solver = DOP853(derivative, 0.0, start, t_end, **bounds)
        while solver.status == "running":
            solver.step()
        return np.asarray(solver.y)

    return end


def with_pinocchio(model: Any) -> Callable[[float, Any], Any]:
    """The derivative by Pinocchio's `aba`, called from Python."""
    data, none = model.createData(), np.zeros(model.nv)

    def derivative(t: float, y: Any) -> Any:
        v = y[model.nq :]
        return np.concatenate((v, pin.aba(model, data, y[: model.nq], v, none)))

    return derivative


def with_lambdify(model: Model) -> Callable[[float, Any], Any]:
    """The derivative by SymPy's `lambdify` with `cse`, of M and the forces, solved at run time."""
    equations = derive(model)
    symbols, collected = equations.symbols, equations.collected
    values = {symbols.parameters[name]: x for name, x in model.defaults.items()}
    mass = collected.M.subs(values)
    push = (collected.F - collected.V - collected.G).subs(values)
    n = len(symbols.q)
    evaluate = sp.lambdify([[*symbols.q, *symbols.v]], (mass, push), modules="numpy", cse=True)

    def derivative(t: float, y: Any) -> Any:
        matrix, right = evaluate(y)
        return np.concatenate((y[n:], np.linalg.solve(matrix, right[:, 0])))

    return derivative


def table(
    name: str,
    ours: Method,
    methods: dict[str, tuple[Method, tuple[float, ...]]],
    off: Callable[[np.ndarray], float],
) -> None:
    """Print times of a motion by other methods, each with its ladder of tolerances or steps, and
    how many times as long as ours they take; `off` is the true error of a state at the end.
    """
    for most in ERRORS:

        @cache
        def loosest(method: Method, ladder: tuple[float, ...], most: float = most) -> float | None:
            return next((x for x in ladder if off(method(x)) < most), None)

        best = loosest(ours, TOLERANCES)
        assert best is not None
        for peer, (method, ladder) in methods.items():
            found = loosest(method, ladder)
            if found is None:
                row(name, f"{most:g}", peer, "not reached", "")
                continue
            calls = (lambda best=best: ours(best), lambda m=method, x=found: m(x))
            times = paired(ROUNDS, *calls)
            per = [f"{1e3 * x:.3g} ms" for x in np.median(times, axis=0)]
            row(name, f"{most:g}", peer, *per[1:], spread(times[:, 1] / times[:, 0]))


def engines(case: Any, count: int, mass: float, half: float, inertia: float) -> None:
    """Print the rows of a chain; `case` is that of `peers.py`."""
    from eomgen.study.accuracy.measure import error

    methods: dict[str, tuple[Method, tuple[float, ...]]] = {
        "MuJoCo, RK4": (
            by_mujoco(rods(count, mass, half, inertia), case.start, case.t_end),
            STEPS,
        ),
        "Pinocchio, SciPy's DOP853": (
            by_scipy(
                with_pinocchio(chain_of_pinocchio(count, mass, half, inertia)),
                case.start,
                case.t_end,
            ),
            TOLERANCES,
        ),
    }
    if count == 2:
        methods["lambdify, SciPy's DOP853"] = (
            by_scipy(with_lambdify(case.model), case.start, case.t_end),
            TOLERANCES,
        )

    def off(y: np.ndarray) -> float:
        return float(error(y, case.true.y[-1], case.true.scale))

    table(case.name, case.by_c, methods, off)
