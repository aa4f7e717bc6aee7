"""A user's script with every public call, for checkers of types: `mypy --strict`, `pyright`.

It is also run, by tests/project/test_package.py, so that what it annotates is what comes back.
"""

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

import eomgen
from eomgen.entries import Body, Gravity, Revolute, Scene

Floats = npt.NDArray[np.float64]


def push(t: float) -> float:
    """An input of time, N."""
    return 0.1 * t


def late(t: float, y: Floats) -> bool:
    """Whether a run has gone on for long enough."""
    return t > 0.2 and bool(np.isfinite(y).all())


def brake(t: float, sensed: Mapping[str, float], state: Mapping[str, object]) -> dict[str, float]:
    """A controller that samples."""
    return {"push": -2.0 * sensed["v"]}


def of_scenes() -> None:
    """Scenes, mechanisms and their equations."""
    version: str = eomgen.__version__
    names: tuple[str, ...] = tuple(eomgen.built_in_names())
    scene: eomgen.Scene = eomgen.read("cart_pole")
    name: str = eomgen.check(scene).name
    found: eomgen.Derivation = eomgen.derive(scene)
    steps: str = found.text()
    print(version, len(names), name, len(steps))
    pin = Revolute(name="pin", parent="world", child="rod", r_child=["-l/2", 0])
    rod = Body(name="rod", mass=2, inertia_com="m*l**2/12")
    numbers = {"m": 2.0, "l": 1.2}
    swing: eomgen.Scene = Scene(
        name="swing", parameters=numbers, bodies=[rod], joints=[pin], effects=[Gravity(g=9.81)]
    )
    print(eomgen.check(swing).freedom)


def of_modules(folder: Path) -> None:
    """Generated code."""
    module: eomgen.Module = eomgen.generate("cart_pole")
    module.save(folder / "cart_pole.py")
    loaded = eomgen.load(module)
    start: Floats = loaded.initial_state()
    rate: Floats = loaded.derivative(0.0, start)
    written: tuple[Path, ...] = eomgen.export("cart_pole", "matlab", folder / "matlab")
    print(rate.shape, len(written), module.source[:3])


def of_runs(folder: Path) -> None:
    """Runs and what they hold."""
    run: eomgen.Run = eomgen.simulate(
        "cart_pole",
        t_end=0.5,
        accuracy=1e-6,
        parameters={"l": 0.4},
        state={"theta": 0.3},
        inputs={"push": "sin(t)"},
        follow=late,
    )
    pushed: eomgen.Run = eomgen.simulate("cart_pole", t_end=0.1, inputs={"push": push})
    held = eomgen.Controller(function=brake, period=0.02, inputs=["push"], sensors={"v": "x_dot"})
    braked: eomgen.Run = eomgen.simulate("cart_pole", t_end=0.1, controllers=[held])
    print(braked.finished)
    angle: Floats = run["theta"]
    energy: Floats = run.energy
    error: float = run.error
    plain = eomgen.simulate("pendulum", t_end=0.1, save=["energy"])
    paths: tuple[Path, ...] = plain.save(folder)
    again: eomgen.Run = eomgen.load_run(folder / "pendulum.npz")
    print(pushed.finished, angle.shape, energy.shape, error, len(paths), again.finished)


def of_many(folder: Path) -> None:
    """Ensembles and pages."""
    many: eomgen.Ensemble = eomgen.ensemble("pendulum", {"bob_mass": [0.5, 1.0]}, t_end=0.1)
    more = eomgen.ensemble(
        "pendulum", eomgen.grid({"bob_mass": np.linspace(0.5, 1.0, 3)}), t_end=0.1
    )
    drawn = eomgen.ensemble(
        "pendulum", eomgen.sampled({"bob_mass": ("uniform", 0.5, 1.0)}, 3), t_end=0.1
    )
    index: Path = eomgen.gallery(folder / "gallery", ["pendulum"], live=False, t_end=0.1)
    print(len(many), len(more), len(drawn), index.name)


def of_studies() -> None:
    """Studies."""
    linear = eomgen.linearise("cart_pole")
    a: Floats = linear.A
    good: bool = not eomgen.verify("pendulum", states=2).missed
    print(a.shape, good)
    print(eomgen.horizon("pendulum", seconds=0.5))
    print(eomgen.arithmetic("pendulum", states=2))
    print(eomgen.accuracy("pendulum", quick=True, t_end=0.2, methods=["rk4"], time=2.0))
    print(eomgen.effects("pendulum", motion=None))
    proof: eomgen.Enclosure = eomgen.certify("pendulum", t_end=0.1, samples=3)
    print(proof.largest, proof.finished)
    pole = eomgen.kinematics("cart_pole")
    print(pole.reach({pole.points[0]: [0.3, 0.2]}, starts=2).converged)


def of_others(robot: Path) -> None:
    """Robot files, and other programs if they are there."""
    tables = eomgen.import_robot(robot).tables
    print(sorted(tables))
    log = {"t": np.linspace(0.0, 1.0, 11), "theta": np.full(11, 0.1)}
    fit: eomgen.Fit = eomgen.fit("pendulum", log, ["theta"])
    value: float = fit.values["theta"]
    print(value, fit.rank)
    print(eomgen.casadi_functions("pendulum"))
    print(eomgen.state_space("cart_pole", outputs=["theta"]))
    print(eomgen.nonlinear_system("cart_pole"))
    print(eomgen.environment("cart_pole", "cos(theta)", actions={"push": (-1.0, 1.0)}))


def of_steps() -> None:
    """Steps with a policy between them."""
    step: eomgen.Stepper = eomgen.stepper("cart_pole", dt=0.01, method="rk4", lanes=8)
    y: Floats = step.initial()
    fallen: npt.NDArray[np.bool_] = np.abs(y[1] - np.pi) > 0.5
    y = step(y, {"push": 1.0}, {"l": np.full(8, 0.4)}, steps=2, reset=fallen, first=y[:, 0])
    step(y, np.zeros((1, 8)), t=0.1, out=y, lost=np.zeros_like(y))
    print(step.projected(y).shape, step.compiled, step.notice, step.module.NAME)


def of_errors() -> None:
    """What a mistake is."""
    try:
        eomgen.simulate("pendulum", t_end=-1.0)
    except eomgen.RunError as error:
        lines: tuple[str, ...] = tuple(error.lines)
        print(lines)
    try:
        eomgen.read({"name": "empty"})
    except eomgen.SceneError as error:
        print(error.lines)


def main(robot: Path) -> None:
    """All of it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        of_scenes()
        of_modules(folder)
        of_runs(folder)
        of_many(folder)
        of_studies()
        of_others(robot)
        of_steps()
        of_errors()


if __name__ == "__main__":
    main(Path(__file__).parent.parent / "arm.urdf")
