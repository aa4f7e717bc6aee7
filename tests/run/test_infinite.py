"""Where an effect is infinite or undefined: every run stops in one clear line, naming it."""

import math
import re
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from engine import engine

from eomgen.base.errors import RunError
from eomgen.commands.main import main
from eomgen.dynamics.start.diagnostics import effect_sizes, is_singular, values_at
from eomgen.run.integrate import integrate
from eomgen.run.integrators import INTEGRATORS, FixedStep
from eomgen.run.module import as_problem
from eomgen.run.trajectory import Trajectory
from eomgen.study.diagnosis import problem_of
from eomgen.tables.integrators import GENERAL

BEAD = """\
name = "bead"
dimensions = {dimensions}
[[bodies]]
name = "bead"
mass = 2.0
inertia_com = 0
[[joints]]
name = "wire"
type = "prismatic"
parent = "world"
child = "bead"
axis = [1, 0{zero}]
coordinate = "x"
[[effects]]
type = "drag"
name = "air"
body = "bead"
linear = 0.01
[[effects]]
name = "pull"
{effect}
[initial]
q = [{x}]
v = [{v}]
"""
ATTRACT = 'type = "field"\nkind = "attract"\nbody = "bead"\nstrength = 1.0'
CENTRE = 'type = "point_gravity"\nmu = 0.5'
MOTOR = 'type = "motor"\njoint = "wire"\ntorque = "{}"'
SERIES = ("taylor",)
ADAPTIVE = [
    name
    for name, method in INTEGRATORS.items()
    if not isinstance(method, FixedStep) and name not in SERIES
]
KEEP_AWAY = "soften it, keep its formula finite there, or keep away"


def scene(effect: str, x: float, v: float = 0.0, dimensions: int = 2) -> str:
    zero = ", 0" if dimensions == 3 else ""
    return BEAD.format(effect=effect, x=x, v=v, dimensions=dimensions, zero=zero)


def run(text: str, integrator: str, t_end: float = 3.0) -> Trajectory:
    """The run, whose rows are finite however it ends."""
    made = engine(text)
    problem = problem_of(made.module, model=made.model)
    dt = 0.01 if isinstance(INTEGRATORS[integrator], FixedStep) else None
    found = integrate(problem, integrator, t_end, dt=dt, samples=40)
    assert np.isfinite(found.y).all()
    assert "\n" not in found.message
    return found


@pytest.mark.every(6)
@pytest.mark.parametrize(
    ("effect", "integrator"),
    [
        *((ATTRACT, integrator) for integrator in ADAPTIVE),
        (CENTRE, "DOP853"),
        (MOTOR.format("-1/x**2"), "LSODA"),
    ],
)
def test_a_fall_into_the_centre(effect: str, integrator: str) -> None:
    """From rest at a the centre is reached at π/2 sqrt(a³/(2 μ)): there the run ends."""
    found = run(scene(effect, 1.0).replace("linear = 0.01", "linear = 1e-12"), integrator)
    assert not found.finished
    shown = re.match(
        r"stopped at t = (\S+), x=(\S+), x_dot=\S+: "
        r"[^:]*: effect 'pull' has grown from 1 to (\S+); ",
        found.message,
    )
    assert shown is not None, found.message
    assert found.message.endswith(KEEP_AWAY)
    time, place, size = (float(part) for part in shown.groups())
    assert time == pytest.approx(math.pi / 2, rel=1e-5)
    assert 0 < place < 1e-5
    assert size == pytest.approx(1 / place**2, rel=1e-2)  # said in three digits
    assert found.t[-1] == pytest.approx(time, rel=1e-5)


@pytest.mark.every(6)
@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize(
    "effect",
    [ATTRACT, CENTRE, *(MOTOR.format(f) for f in ("1/x", "log(x)", "acos(x + 1.5)", "exp(1/x)"))],
)
def test_infinite_at_the_start(
    effect: str, dimensions: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The message is about the effect, and not about the mass matrix, which is a mere number."""
    path = tmp_path / "bead.toml"
    path.write_text(scene(effect, 0.0, 0.0, dimensions))
    for command in (["generate"], ["simulate", "--t-end", "1"]):
        assert main([*command, str(path), "-o", str(tmp_path / "out")]) == 1
        assert capsys.readouterr().err == (
            "eomgen: bead.toml: at the initial state effect 'pull' has no finite value; "
            f"{KEEP_AWAY}\n"
        )


@pytest.mark.parametrize(
    "integrator",
    [name for name in GENERAL if not name.startswith("leapfrog") and name not in SERIES],
)
@pytest.mark.parametrize(
    ("formula", "x", "v", "low", "high"),
    [
        ("-log(x)", 0.5, -2.0, -0.03, 0.05),
        ("-sqrt(1 - x)", 0.5, 2.0, 0.95, 1.03),
        ("asin(x)", 0.5, 2.0, 0.95, 1.03),
        ("1/max(0.9 - x, 0)", 0.5, 2.0, 0.84, 0.95),
    ],
)
@pytest.mark.every(12)
def test_undefined_on_the_way(
    formula: str, x: float, v: float, low: float, high: float, integrator: str
) -> None:
    """Where a formula loses its value, to the step, whatever the method."""
    found = run(scene(MOTOR.format(formula), x, v), integrator)
    assert not found.finished
    if "Newton" in found.message:
        assert low <= found.y[-1, 0] <= high
        return
    place = r"stopped at t = \S+, x=(\S+), x_dot=\S+: "
    cause = (
        rf"(there|in the next step) effect 'pull' has no finite value; {KEEP_AWAY}"
        r"|.* effect 'pull' has grown from \S+ to \S+; .*"
    )
    shown = re.fullmatch(f"{place}({cause})", found.message)
    assert shown is not None, found.message
    assert low <= float(shown[1]) <= high


def test_a_root_without_a_slope() -> None:
    """sqrt(x) at 0 has a value and no Jacobian: methods that need none go on."""
    text = scene(MOTOR.format("sqrt(x)"), 0.0)
    assert run(text, "DOP853").finished
    message = run(text, "Radau").message
    assert message.startswith("stopped at t = 0, x=0, x_dot=0: the Jacobian: ZeroDivisionError")


def test_a_formula_of_time() -> None:
    """1/(1 - t) at the very time."""
    found = run(scene(MOTOR.format("1/(1 - t)"), 0.0), "euler")
    assert re.match(
        r"stopped at t = 1, x=\S+, x_dot=\S+: there effect 'pull' has no", found.message
    )


def test_a_state_s_rate_counts() -> None:
    """A controller's own state may be what has no value."""
    states = 'type = "controller"\nstates = { z = { rate = "1/x" } }\ntorques = { wire = "z" }'
    text = scene(states, 0.0)
    made = engine(text)
    with pytest.raises(RunError, match=r"^at the initial state effect 'pull' has no finite value"):
        problem_of(made.module, model=made.model)


def test_what_is_singular_is_reported_from_what_is_infinite() -> None:
    """The mass matrix is tried without the effects, and effects without it."""
    text = scene(ATTRACT, 0.0)
    model = engine(scene(ATTRACT, 1.0)).model
    y = [0.0, 0.0]
    values = values_at(model, 0.0, y, {}, {})
    assert effect_sizes(model, values) == {"air": 0.0, "pull": math.inf}
    assert not is_singular(model, values)
    light = replace(
        model,
        parameters=tuple(
            replace(p, default=0.0) if p.name == "bead_mass" else p for p in model.parameters
        ),
    )
    assert is_singular(light, values_at(light, 0.0, [1.0, 0.0], {}, {}))
    with pytest.raises(
        RunError, match="mass matrix is singular at the initial state, or an effect"
    ):
        as_problem(engine(text).module)  # without the model nobody knows


def test_columns_keep_apart() -> None:
    """Of many states at once those without a value are inf or nan, and the others right."""
    module = engine(scene(MOTOR.format("log(x)/(x - 1)"), 2.0)).module
    y = np.array([[2.0, 1.0, -1.0, 0.0, 3.0], [0.5] * 5])
    with np.errstate(all="ignore"):
        found = module.derivative(0.0, y)
    assert (np.isfinite(found[1]) == [True, False, False, False, True]).all()
    for k in (0, 4):
        assert found[:, k] == pytest.approx(module.derivative(0.0, y[:, k]), rel=1e-14)


def test_columns_in_blocks() -> None:
    """Thousands of states are computed in blocks, with the results of a few, in little memory."""
    module = engine(scene(MOTOR.format("t*x + sin(t)"), 2.0)).module
    rng = np.random.default_rng(1)
    y, t = rng.uniform(-1.0, 1.0, (2, 5000)), rng.uniform(0.0, 9.0, 5000)
    y[0, 4500] = np.inf
    whole = module.derivative(t, y)
    parts = [module.derivative(t[i : i + 7], y[:, i : i + 7]) for i in range(0, 5000, 7)]
    assert np.array_equal(whole, np.hstack(parts), equal_nan=True)
    assert np.flatnonzero(np.isnan(whole[1])).tolist() == [4500]
    assert module.derivative(t[:0], y[:, :0]).shape == (2, 0)
    many = np.repeat(y[:, :1], 100_000, axis=1)
    tracemalloc.start()
    module.derivative(0.0, many)
    assert tracemalloc.get_traced_memory()[1] < 1.5 * many.nbytes  # the result is one of them
    tracemalloc.stop()


def test_parameters_of_the_run_count() -> None:
    """What the command line sets is what the message is about."""
    text = scene(MOTOR.format("1/(x - a)"), 1.0).replace(
        "[[bodies]]", "[parameters]\na = 0.5\n[[bodies]]"
    )
    made = engine(text)
    y = np.array([1.0, 0.0])
    assert problem_of(made.module, model=made.model).explain(0.0, y, y) is None
    with pytest.raises(RunError, match=r"^at the initial state effect 'pull' has no finite value"):
        problem_of(made.module, {"a": 1.0}, None, made.model)
    with pytest.raises(RunError, match=r"^at the initial state effect 'pull' has no finite value"):
        problem_of(
            made.module,
            np.array([*{**made.module.PARAMETERS, "a": 1.0}.values()]),
            None,
            made.model,
        )


def test_what_is_driven_is_no_reason() -> None:
    """A run that stops beside a drive is explained, and the drive's coordinate is no state."""
    effect = 'type = "driven"\njoint = "wire"\ncoordinate = "sin(t)"'
    text = scene(effect, 0.0)
    text = text[: text.index("[initial]")] + (
        '[[bodies]]\nname = "bob"\nmass = 1.0\ninertia_com = 0.1\n'
        '[[joints]]\nname = "pin"\ntype = "revolute"\nparent = "bead"\nchild = "bob"\n'
        "r_child = [0, 0.5]\n"
    )
    model = engine(text).model
    assert not is_singular(model, values_at(model, 0.0, [0.0, 0.0], {}, {}))
