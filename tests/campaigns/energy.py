"""Energy of the two-body scene over many periods: who keeps it, and who loses it.

    python tests/campaigns/energy.py [--periods 100000] [--only scene rk4] [--stretch 2] [-o FILE]

takes some half an hour of one core for 1e5 periods; a run that is done is kept beside the figure
(`--kept`) and not done again. `test_integrators.py` does a few hundred periods of the same.

The scene's bodies fly freely, so they are watched from the frame that falls with them, their centre
of mass at rest: without gravity, and without the energy of the flight, which is seventy times that
of the tumbling and would hide it. One period is one turn of the joint, 0.974 s.

The state (q, v) of a scene is not canonical once the mass matrix depends on q, nor are the momenta
of its other forms, which are those of each body alone. Gauss's methods are then not symplectic, but
symmetric, which serves as well here: the tumbling is reversible and integrable (Hairer, Lubich,
Wanner, Geometric Numerical Integration, section XI.3). Hence the same motion in canonical momenta,
too, p = M(q) v, where they are symplectic (section VI.4).
"""

import argparse
import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from eomgen.model.elaborate import elaborate
from eomgen.pipeline import generate
from eomgen.run.integrate import integrate
from eomgen.run.module import GeneratedModule, as_problem, load_module
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.progress import terminal_progress
from eomgen.scene.reader import BUILT_IN, read_scene
from eomgen.show.style import PALETTE, style, write_figure

PERIOD = 0.9742
"""s, of the joint's angle in this motion."""
BLOCKS = 100
ROWS = 100_001

STEPS = {"implicit_midpoint": 0.05, "gauss_4": 0.1, "gauss_6": 0.1, "rk4": 0.02}
"""s; of much the same cost a period, and none divides it."""
RUNS = (
    *(("scene", method) for method in STEPS),
    *(("canonical", method) for method in STEPS if method != "rk4"),
)


@dataclass(frozen=True, eq=False)
class Motion:
    """A problem, and the energy (n,), J, of states (n, ny)."""

    problem: Problem
    energy: Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Drift:
    """What became of the energy, in parts of itself.

    band   its greatest change
    slope  its trend, a period, by least squares over the means of blocks of the run; `error` is its
           standard error, from how the means scatter
    """

    band: float
    slope: float
    error: float


def scene() -> tuple[GeneratedModule, Motion]:
    """The two-body scene as `eomgen simulate` runs it, without gravity, its centre at rest."""
    text = (BUILT_IN / "two_body.toml").read_text("utf-8")
    text = text.replace("g = { value = 9.81", "g = { value = 0.0")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "two_body.toml"
        path.write_text(text, "utf-8")
        module = load_module(generate(elaborate(read_scene(str(path)))).module)
    p = module.PARAMETERS
    assert p["g"] == 0.0
    problem = as_problem(module)
    start = problem.initial.copy()
    ahead = [module.STATES.index(state) for state in ("x_A_dot", "y_A_dot")]
    start[ahead] -= module.momentum(0.0, start)[:2] / (p["m_A"] + p["m_B"])
    return module, Motion(
        replace(problem, initial=start),
        lambda y: np.asarray(module.kinetic_energy(0.0, y.T)),
    )


def canonical() -> Motion:
    """The same by Hamilton's equations, states α, β, the angles of both bodies, and their momenta.

    H = pᵀ M⁻¹ p / 2 with M = [[a, k], [k, b]], k = c cos(β - α): the kinetic energy about the
    centre of mass, of which the bodies are m_B/m and m_A/m times their distance away.
    """
    module, motion = scene()
    p, y = module.PARAMETERS, dict(zip(module.STATES, motion.problem.initial.tolist(), strict=True))
    reduced = p["m_A"] * p["m_B"] / (p["m_A"] + p["m_B"])
    a = p["I_A"] + reduced * p["l_A"] ** 2
    b = p["I_B"] + reduced * p["l_B"] ** 2
    c = reduced * p["l_A"] * p["l_B"]

    def rates(y: FloatArray) -> FloatArray:
        """α̇ and β̇ (2, n) of states in columns (4, n)."""
        k = c * np.cos(y[1] - y[0])
        return np.array([b * y[2] - k * y[3], a * y[3] - k * y[2]]) / (a * b - k * k)

    def at(y: FloatArray) -> tuple[float, float, float, float, float]:
        """α̇, β̇, c sin(β - α), k and det M of one state."""
        alpha, beta, p_alpha, p_beta = y.tolist()
        k = c * math.cos(beta - alpha)
        det = a * b - k * k
        u, v = (b * p_alpha - k * p_beta) / det, (a * p_beta - k * p_alpha) / det
        return u, v, c * math.sin(beta - alpha), k, det

    def derivative(t: float, y: FloatArray) -> FloatArray:
        u, v, s, _, _ = at(y)
        return np.array([u, v, s * u * v, -s * u * v])

    def jacobian(t: float, y: FloatArray) -> FloatArray:
        u, v, s, k, det = at(y)
        # By β - α at constant momenta, and by the momenta: the inverse of M.
        u_turn, v_turn = s * (b * v - k * u) / det, s * (a * u - k * v) / det
        first = (-u_turn, u_turn, b / det, -k / det)
        second = (-v_turn, v_turn, -k / det, a / det)
        bend = (-k * u * v, k * u * v, 0.0, 0.0)
        force = [s * (du * v + u * dv) + df for du, dv, df in zip(first, second, bend, strict=True)]
        return np.array([first, second, force, [-df for df in force]])

    alpha, beta = y["theta"], y["theta"] + y["phi"]
    u, v = y["theta_dot"], y["theta_dot"] + y["phi_dot"]
    k = c * np.cos(beta - alpha)
    problem = Problem(
        name="two_body in canonical momenta",
        states=("alpha", "beta", "p_alpha", "p_beta"),
        positions=(0, 1),
        derivative=derivative,
        jacobian=jacobian,
        initial=np.array([alpha, beta, a * u + k * v, k * u + b * v]),
    )
    return Motion(problem, lambda y: np.asarray((rates(y.T) * y.T[2:]).sum(axis=0) / 2))


def run(
    motion: Motion, method: str, periods: float, dt: float, label: str = ""
) -> tuple[FloatArray, FloatArray]:
    """Periods gone by, and the energy's change in parts of itself, both (n,)."""
    with terminal_progress(label or method) as progress:
        found = integrate(
            motion.problem,
            method,
            periods * PERIOD,
            dt=dt,
            samples=ROWS,
            max_steps=10**9,
            progress=progress,
        )
    assert found.finished, found.message
    energy = motion.energy(found.y)
    return found.t / PERIOD, energy / energy[0] - 1


def drift(periods: FloatArray, change: FloatArray) -> Drift:
    """Band and trend of a run."""
    at = np.array([block.mean() for block in np.array_split(periods, BLOCKS)])
    means = np.array([block.mean() for block in np.array_split(change, BLOCKS)])
    (slope, _), covariance = np.polyfit(at, means, 1, cov=True)
    return Drift(float(np.abs(change).max()), float(slope), float(np.sqrt(covariance[0, 0])))


def draw(
    kept: dict[tuple[str, str], tuple[FloatArray, FloatArray]], stretch: float, path: Path
) -> None:
    """The greatest change of energy so far, over periods, both logarithmic."""
    with style():
        figure = Figure(figsize=(8.0, 4.2), layout="constrained")
        axes = figure.subplots()
        for (form, method), (periods, change) in kept.items():
            rows = np.unique(np.geomspace(1, len(periods) - 1, 400).astype(int))
            worst = np.maximum.accumulate(np.abs(change))
            axes.loglog(
                periods[rows],
                worst[rows],
                color=PALETTE[list(STEPS).index(method)],
                linestyle="-" if form == "scene" else ":",
                label=f"{method}, dt = {stretch * STEPS[method]:g} s"
                + ("" if form == "scene" else ", canonical"),
            )
        axes.set_xlabel("periods")
        axes.set_ylabel("greatest change of the energy so far, in parts of it")
        axes.set_title("two_body: energy over many periods")
        axes.legend(fontsize=8)
        write_figure(figure, path, force=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what is not kept yet, print a table, draw."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--periods", type=float, default=1e5)
    parser.add_argument("--only", metavar="NAME", nargs="*", default=[], help="forms or methods")
    parser.add_argument("--stretch", type=float, default=1.0, help="steps this many times as long")
    parser.add_argument("--kept", type=Path, default=Path("out/energy"), help="folder of runs")
    parser.add_argument("-o", type=Path, default=Path("docs/energy_two_body.png"))
    given = parser.parse_args(arguments)
    given.kept.mkdir(parents=True, exist_ok=True)
    motions = {"scene": scene()[1], "canonical": canonical()}
    kept = {}
    for form, method in RUNS:
        forms, methods = (set(given.only) & set(names) for names in (motions, STEPS))
        if form not in (forms or motions) or method not in (methods or STEPS):
            continue
        dt = given.stretch * STEPS[method]
        path = given.kept / f"{form}_{method}_{given.periods:g}_{dt:g}.npz"
        if not path.exists():
            periods, change = run(motions[form], method, given.periods, dt, f"{form} {method}")
            np.savez(path, periods=periods, change=change)
        with np.load(path) as data:
            kept[form, method] = data["periods"], data["change"]
        found = drift(*kept[form, method])
        print(
            f"{form:10} {method:18} dt {dt:<5g} max |dE|/E {found.band:.2e}   trend "
            f"{found.slope:+.1e} ± {found.error:.0e} a period, {found.slope * given.periods:+.1e} "
            "in all",
            flush=True,
        )
    draw(kept, given.stretch, given.o)


if __name__ == "__main__":
    main()
