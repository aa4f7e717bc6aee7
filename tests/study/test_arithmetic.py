"""Accuracy of each route's accelerations: the reference, the errors in ulps, the results."""

import csv
import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import gmpy2
import mpmath
import numpy as np
import pytest
from engine import MP, Digits, apart, exact, read
from scenes import effect, lone

from eomgen.codegen.system import System
from eomgen.commands.main import main
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import compile_program, python_module
from eomgen.program.extended import evaluator
from eomgen.program.program import Output, Program, finish, interpret
from eomgen.program.tape import TIME, ExactTape, Stage, Tape
from eomgen.run.module import load_module
from eomgen.scalars.functions import BY_MATH, FUNCTIONS
from eomgen.scene.schema import Simulation
from eomgen.study import timing
from eomgen.study.cost.arithmetic import BASELINE, Arithmetic, Solver, arithmetic, solve_operations
from eomgen.study.cost.single import Single, in_single, kernel_in_single
from eomgen.study.verification import sampled as sampling
from eomgen.study.verification.sampled import sampled
from eomgen.study.verification.states import random_state
from eomgen.study.verification.truth import Truth
from eomgen.study.verification.ulps import component_errors, ulp, vector_errors
from eomgen.tables.routes import routes_for

ROD = """
name = "rod"
bodies = [{ name = "a", mass = 1.3, inertia_com = 0.07 }]
effects = [{ type = "gravity", g = 9.81 }]
joints = [
    { name = "pin", type = "revolute", parent = "world", child = "a", r_child = [0.0, 0.7], \
coordinate = "q" },
]
"""
"""A compound pendulum of bare numbers."""

CART = """
name = "cart"
bodies = [{ name = "c", mass = MASS, inertia_com = 0 }, { name = "p", mass = 1, inertia_com = 0 }]
effects = [{ type = "gravity", g = 9.81 }]
initial = { q = { q_deg = ANGLE } }
simulation = { t_end = 3.0, rtol = 1e-10, atol = 1e-12 }
[[joints]]
name = "rail"
type = "prismatic"
parent = "world"
child = "c"
axis = [1.0, 0.0]
coordinate = "x"
[[joints]]
name = "pin"
type = "revolute"
parent = "c"
child = "p"
r_child = [0, 1]
coordinate = "q"
"""
"""A point of mass below a cart of hardly any."""

ALL_FUNCTIONS = lone(
    "prismatic",
    effect("controller", name="all", torques={"pin": "FORMULA"}),
    on="pin",
    name="push",
    parameters={"k": 1.7, "a": 0.3},
    mass=1.3,
    inertia_com=0.07,
    axis=[1, 0],
    coordinate="x",
)
FORMULA = (
    "sin(k)*cos(x) + tan(a*x) + asin(a)*acos(x/9) + atan(k*x) + exp(a*x) + log(k + x*x) + tanh(x)"
    " + sqrt(k)*abs(x) + step(x) + step(a) + atan2(x, k) + min(x, a) + max(x, sin(a)) + 0.1*t"
    " + (x if x < a else 2) + (1 if x > a else 2)"
)


@pytest.fixture(autouse=True)
def in_little_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Times do not matter here, and few states suffice."""
    monkeypatch.setattr(timing, "TIMING", 0.0)
    monkeypatch.setattr(sampling, "MOST_OPERATIONS", 200_000)


def model_of(scene: str) -> Model:
    """The model of a built-in scene or of a text."""
    return elaborate(read(scene))


def scene_of(scene: str) -> tuple[Model, Simulation]:
    """The same, and the scene's simulation settings."""
    return model_of(scene), read(scene).simulation


@cache
def judged(scene: str, states: int = 30, *, single: bool = False) -> Arithmetic:
    """The comparison of solvers for a scene."""
    return arithmetic(*scene_of(scene), states=states, single=single)


def solver(found: Arithmetic, name: str, precision: str = "float64") -> Solver:
    """One of the solvers."""
    return next(w for w in found.solvers if (w.name, w.precision) == (name, precision))


def bare(scene: str, route: str = "auto") -> System:
    """The derivative of a scene by a route, without other outputs."""
    model = replace(model_of(scene), outputs=(), route=route, form="velocity")
    return compile_program(model, jacobian=False).system


def states_of(system: System, count: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Some times and states."""
    rng = np.random.default_rng(3)
    module: Any = load_module(python_module(system))
    return rng.uniform(0, 2, count), np.array([random_state(module, rng) for _ in range(count)])


def in_digits(system: System, program: Program, t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """v̇ of a program in 60 digits, in columns."""
    nq, nv = len(system.model.coordinates), len(system.model.velocities)
    run, names = evaluator(program, "derivative"), [state.name for state in system.states]
    given = {**system.model.defaults, **{i.name: 0.0 for i in system.model.inputs}}
    columns = [
        run({**given, **dict(zip(names, state, strict=True)), TIME: time})[nq : nq + nv]
        for time, state in zip(t, y, strict=True)
    ]
    return np.array(columns, dtype=object).T


# The truth.


def test_truth_of_a_compound_pendulum() -> None:
    """θ̈ = -m g l sin θ / (I + m l²) with exactly the doubles of the scene."""
    y = np.array([[0.3, 1.0], [2.0, -3.0], [-1e-9, 0.0]])
    mass, g, length, inertia = map(MP.mpf, (1.3, 9.81, 0.7, 0.07))
    factor = -mass * g * length / (inertia + mass * length * length)
    expected = [factor * MP.sin(MP.mpf(x)) for x in y[:, 0]]
    assert apart(Truth(model_of(ROD))(np.zeros(3), y)[0], np.array(expected)) < 1e-57


@pytest.mark.parametrize("scene", ["two_body", "furuta_pendulum", "tumbling_body", CART])
def test_truth_agrees_with_other_routes(scene: str) -> None:
    """LᵀDL without a recording, and the program itself if no constant of the scene was folded."""
    scene = scene.replace("MASS", "0.3").replace("ANGLE", "20")
    system = bare(scene, "ldl")
    truth, (t, y) = Truth(system.model), states_of(system)
    true = truth(t, y)
    factored = np.array([truth.factored(*at) for at in zip(t, y, strict=True)]).T
    assert apart(factored, true) < 1e-50
    off = apart(in_digits(system, system.program, t, y), true)
    assert off < 1e-50 or (scene.startswith("\n") and 0 < off < 1e-15)


def test_a_wrong_last_digit_is_seen() -> None:
    """In each constant of a program in turn; without it 40 digits agree."""
    system = bare("two_body", "aba")
    (t, y), program = states_of(system, 2), system.program
    true = Truth(system.model)(t, y)
    assert apart(in_digits(system, program, t, y), true) < 1e-40
    places = [i for i, step in enumerate(program.steps) if step.operation == "constant"]
    nodes = {n for step in program.steps for n in step.operands}
    seen = 0
    for i in places:
        steps = list(program.steps)
        value = steps[i].value
        assert isinstance(value, float)
        steps[i] = steps[i]._replace(value=float(np.nextafter(value, 9.0)))
        off = apart(in_digits(system, replace(program, steps=tuple(steps)), t, y), true)
        seen += 1e-25 < off < 1e-10
    given = {n: v * (1 + 2**-52) for n, v in system.model.defaults.items()}
    for name in given:
        other = Truth(system.model.with_parameters({name: given[name]}))(t, y)
        seen += 1e-20 < apart(other, true) < 1e-12
    assert places or not nodes
    assert seen > len(given) // 2


def test_exact_tape_folds_what_is_exact() -> None:
    """0.5 · 4 = 2 is folded, a third is not, as it is no double."""
    for tape, folded in ((Tape(), True), (ExactTape(), False)):
        number = tape.constant
        assert tape.values[(number(0.5) * number(4.0)).index] == 2.0
        assert tape.values[(number(0.0) * tape.input("x", 0)).index] == 0.0  # type: ignore[arg-type]
        for node in (
            number(1.0) / number(3.0),
            number(0.1) + number(0.2),
            number(0.1) * number(3.0),
            number(1e300) - number(1.0),
            tape.apply("sin", number(1.0)),
        ):
            assert (node.index in tape.values) == folded


def test_no_truth_at_a_singular_state() -> None:
    """None at a singular state, and the reference beside it."""
    polar = """
    name = "polar"
    initial = { q = { r = 1.0 } }
bodies = [
    { name = "a", mass = 1e-9, inertia_com = 0 },
    { name = "b", mass = 1, inertia_com = 0 },
]
joints = [
    { name = "pin", type = "revolute", parent = "world", child = "a", coordinate = "q" },
    { name = "arm", type = "prismatic", parent = "a", child = "b", axis = [1, 0], \
coordinate = "r" },
]
"""
    truth = Truth(model_of(polar))
    y = np.array([[0.2, 0.0, 1.0, 0.0], [0.2, 0.5, 2.0, 0.0]])
    found = truth(np.zeros(2), y)
    assert found[0, 0] is None and found[1, 0] is None
    assert (found[0, 1], found[1, 1]) == (0, 2)  # r θ̇² outwards


# Counting.


def test_ulp_is_the_distance_of_neighbours() -> None:
    """At powers of two and between them, in both formats."""
    rng = np.random.default_rng(1)
    for x in (1.0, 0.5, 1.9999999, 1024.0, 3e-300, *rng.lognormal(0, 30, 50)):
        assert ulp(MP.mpf(x), 53) == np.spacing(x)
        if 1e-30 < x < 1e30:
            single = np.float32(x)
            assert ulp(MP.mpf(float(single)), 24) == np.spacing(single)


def test_errors_by_hand() -> None:
    """Neighbours differ by 1 ulp, below a power of two by half; vectors, by unit."""
    units = ["rad/s", "m/s", "rad/s"]
    true = exact(np.array([[3.0, 1.0], [5e8, 5e8], [0.25, -1.0]]))
    found = true.astype(float)
    assert vector_errors(found, true, units, 53).tolist() == [0, 0]
    found[0] = np.nextafter(found[0], 9.0)
    assert vector_errors(found, true, units, 53).tolist() == [1, 1]
    assert vector_errors(found, true, units, 24) == pytest.approx([2.0**-29, 2.0**-29])
    found[0, 1] = np.nextafter(1.0, 0.0)
    assert vector_errors(found, true, units, 53).tolist() == [1, 0.5]
    found[2, 0] += 3 * np.spacing(2.0)  # 24 of its own
    assert vector_errors(found, true, units, 53).tolist() == [3, 0.5]
    assert component_errors(found, true, 53).tolist() == [1, 0.5, 0, 0, 24, 0]
    found[1, 1] = np.nextafter(5e8, 0)
    found[0, 0] = np.nan
    assert vector_errors(found, true, units, 53).tolist() == pytest.approx([np.nan, 1], nan_ok=True)
    assert component_errors(found, true, 53).tolist() == [0.5, 0, 1, 24, 0]


def test_errors_beside_nothing() -> None:
    """The scale is at least a thousandth of the median; an error in an exact 0 is infinite."""
    still = exact(np.array([[0.0, 0.0, 0.0]]))
    assert vector_errors(np.zeros((1, 3)), still, ["m/s"], 53).tolist() == [0, 0, 0]
    assert vector_errors(np.full((1, 3), 1e-17), still, ["m/s"], 53)[0] == math.inf
    dying = exact(np.array([[4000.0, 1000.0, 1e-20, 1.0]]))
    found = dying.astype(float) + np.array([[0.0, 0.0, np.spacing(1.0), np.spacing(1.0)]])
    errors = vector_errors(found, dying, ["m/s"], 53)
    assert errors.tolist() == pytest.approx([0, 0, 1, 1], abs=1e-3)


def test_operations_of_a_dense_solution() -> None:
    """Elimination and back substitution, with every operation counted by hand."""
    counts = [
        sum(1 + 2 * (n - k) for k in range(1, n) for _ in range(k, n))
        + sum(2 * (n - k) for k in range(1, n))
        + sum(2 * (n - i) + 1 for i in range(1, n + 1))
        for n in (1, 2, 3, 7)
    ]
    assert counts == [1, 9, 28, 294] == [solve_operations(n) for n in (1, 2, 3, 7)]


# float32.


@pytest.mark.parametrize("scene", ["two_body", "tumbling_body", "functions"])
def test_program_and_module_go_the_same_steps(scene: str) -> None:
    """To the bit in doubles; in float32 but for the rounding of constants."""
    text = ALL_FUNCTIONS.replace("FORMULA", FORMULA)
    system = bare(text if scene == "functions" else scene)
    module: Any = load_module(python_module(system))
    t, y = states_of(system, 8)
    t *= 0

    class Doubles(Single):
        def number(self, value: float) -> Any:
            return value

        def call(self, function: str, *arguments: Any) -> Any:
            # As in the module: what depends on parameters alone by the mathematical library, whose
            # last bits need not be NumPy's.
            if all(isinstance(x, float) for x in arguments):
                return BY_MATH[function](*arguments)
            return super().call(function, *arguments)

    given = dict(zip(module.STATES, y.T, strict=True)) | system.model.defaults
    given |= dict.fromkeys(module.INPUTS, 0.0) | {TIME: 0.0}
    expected = module.derivative(0.0, y.T)
    found = interpret(system.program, "derivative", given, Doubles())
    for i, row in enumerate(expected):
        np.testing.assert_array_equal(np.broadcast_to(found[i], row.shape), row)
    single = in_single(system, "derivative", t, y)
    kernel = kernel_in_single(module, "derivative")
    assert single.dtype == kernel(y.T.astype(np.float32)).dtype == np.float32
    assert kernel(y.T.astype(np.float32)) == pytest.approx(single, rel=3e-6, abs=3e-6)
    assert kernel(y[0].astype(np.float32)) == pytest.approx(single[:, 0], rel=3e-6, abs=3e-6)
    assert single == pytest.approx(expected, rel=3e-5, abs=3e-5)
    assert not np.all(single == expected)


def test_no_step_leaves_float32(monkeypatch: pytest.MonkeyPatch) -> None:
    """Constants, parameters, time and every function."""
    system = bare(ALL_FUNCTIONS.replace("FORMULA", FORMULA))
    t, y = states_of(system)
    used, kinds = set(), set()
    call = Single.call

    def spied(self: Single, function: str, *arguments: Any) -> Any:
        result = call(self, function, *arguments)
        used.add(function)
        kinds.update(x.dtype for x in (result, *arguments))
        return result

    monkeypatch.setattr(Single, "call", spied)
    in_single(system, "derivative", t, y)
    assert len(used) > 14 and kinds == {np.dtype("float32")}
    with pytest.raises(AssertionError, match="is beyond the range of float32"):
        monkeypatch.setattr(Single, "number", lambda _, x: np.float64(x))
        in_single(system, "derivative", t, y)


def test_float32_loses_29_bits() -> None:
    """The same number of ulps, each of them 2^29 times as large."""
    found = judged("two_body", single=True)
    for route in ("closed", "ldl", "aba", BASELINE):
        double, single = solver(found, route), solver(found, route, "float32")
        assert double.operations == single.operations
        for ours, theirs in zip(double.errors, single.errors, strict=True):
            assert 1 / 4 < theirs.median / ours.median < 4
            assert 1 / 10 < theirs.component / ours.component < 10


# What is found.


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", ["double_pendulum", "two_body", "tumbling_body"])
def test_every_route_is_exact_where_masses_are_even(scene: str) -> None:
    """A few ulps at most states, some hundred at the worst; every route is compared."""
    found = judged(scene, single=scene == "two_body")
    assert found.agreed > 55
    assert {w.name for w in found.solvers} == {*routes_for(loops=False), BASELINE} - {"mixed"}
    for w in found.solvers:
        assert not w.words and w.seconds and w.batch_seconds
        for errors, sample in zip(w.errors, found.samples, strict=True):
            assert 0 < errors.median < 15
            assert errors.worst < 500
            assert errors.failed == 0
            assert len(errors.ulps) == len(sample.y)
    assert [s.kind for s in found.samples] == ["seeded", "scene's run"]


def test_solution_by_hand_keeps_what_a_light_cart_loses() -> None:
    """The closed form keeps every digit; routes that add the cart's mass to the pole's lose it."""
    found = judged(CART.replace("MASS", "1e-6").replace("ANGLE", "90"), 60)
    seeded, own = solver(found, "closed").errors
    assert max(seeded.worst, own.worst) < 5
    worse = solver(found, BASELINE).errors
    assert worse[1].worst > 1e4 * own.worst
    assert worse[1].median > 25 * own.median
    assert np.max(found.samples[1].condition) > 1e4
    assert found.samples[1].until > 2  # twice through below


def test_a_solver_that_fails_says_why() -> None:
    """1 kg + 1e-20 kg = 1 kg: at the rest of the run, M is singular but for the closed form."""
    found = judged(CART.replace("MASS", "1e-20").replace("ANGLE", "0"), 5)
    assert solver(found, "closed").errors[1].worst == 0
    for name, words in ((BASELINE, "Singular matrix"), ("ldl", "division by zero")):
        failed = solver(found, name)
        assert failed.errors[1].failed == len(found.samples[1].y)
        assert words in failed.words and "of" in failed.words
        assert np.isnan(failed.errors[1].worst) and failed.errors[1].at is None


def test_the_same_seed_the_same_numbers() -> None:
    """And another seed gives others."""
    one, two = (arithmetic(*scene_of("pendulum"), states=5) for _ in range(2))
    other = arithmetic(*scene_of("pendulum"), states=5, seed=1)
    for k in (0, 1):
        np.testing.assert_array_equal(one.samples[k].y, two.samples[k].y)
        for w in one.solvers:
            np.testing.assert_array_equal(w.errors[k].ulps, solver(two, w.name).errors[k].ulps)
    assert not np.any(one.samples[0].y == other.samples[0].y)
    np.testing.assert_array_equal(one.samples[1].y, other.samples[1].y)


def test_states_of_its_own_run() -> None:
    """Evenly spaced among the calls within the run; fewer calls allowed end it sooner."""
    system, wanted = bare("cart_pole"), read("cart_pole").simulation
    module: Any = load_module(python_module(system))
    calls, derivative = [], module.derivative

    def noted(t: float, y: np.ndarray) -> np.ndarray:
        calls.append((t, *y))
        return derivative(t, y)

    module.derivative = noted
    run = sampled(system.model, wanted, module, 9)
    assert len(run.t) == 9 and run.t[0] == 0 and run.until > 9
    at = [calls.index(row) for row in zip(run.t, *run.y.T, strict=True)]
    assert min(np.diff(at)) > 0.9 * max(np.diff(at)) > 20  # among hundreds of calls
    np.testing.assert_array_equal(run.y[0], module.initial_state())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sampling, "MOST_OPERATIONS", 60 * 18)
        assert sampled(system.model, wanted, module, 40).until < 0.5


# The command.


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Table, figure, and a row for each state, from which the worst one can be found."""
    asked = ["accuracy", "two_body", "--arithmetic", "--float32", "--states", "6"]
    assert main([*asked, "-o", str(tmp_path)]) == 0
    output = capsys.readouterr()
    assert output.err == ""
    lines = output.out.splitlines()
    assert max(len(line) for line in lines if not line.startswith("    wrote ")) <= 100
    assert sum(line.split()[:1] == ["aba"] for line in lines) == 2
    assert (tmp_path / "two_body_arithmetic.png").stat().st_size > 10_000
    text = (tmp_path / "two_body_arithmetic.csv").read_text("utf-8").splitlines()
    rows = list(csv.DictReader(text))
    assert len(rows) == 12
    system = bare("two_body", "aba")
    module: Any = load_module(python_module(system))
    units = [c.unit for c in system.model.velocities]
    truth = Truth(system.model)
    for kind in ("seeded", "scene's run"):
        there = [row for row in rows if row["state_kind"] == kind]
        y = np.array([[float(row[name]) for name in module.STATES] for row in there])
        found = np.array([module.derivative(0.0, row)[4:] for row in y]).T
        errors = vector_errors(found, truth(np.zeros(6), y), units, 53)
        assert [float(row["aba float64"]) for row in there] == pytest.approx(errors, rel=1e-4)
    (tmp_path / "two_body_arithmetic.csv").write_text("mine", "utf-8")
    assert main([*asked, "-o", str(tmp_path)]) == 1


def test_command_reports_what_is_not_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Another form, contacts; and invalid options."""
    other = ["--states", "3", "-o", str(tmp_path)]
    assert main(["accuracy", "bouncing_two_body", "--arithmetic", *other]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "all rigid contacts open" in text
    assert "chosen: closed" in text
    for wrong in (["--states", "0"], ["--seed", "-1"], ["--set", "M=1"]):
        assert main(["accuracy", "pendulum", "--arithmetic", *wrong, "-o", str(tmp_path)]) == 1
        assert capsys.readouterr().err.startswith(f"eomgen: {wrong[0]}: ")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_in_sixty_digits(name: str) -> None:
    """Every function of formulas, alone and in a program, against mpmath in 80 digits."""
    tape, count = Tape(), FUNCTIONS[name]
    node = tape.apply(name, *(tape.input(x, Stage.POSITIONS) for x in "abc"[:count]))
    run = evaluator(finish(tape, {"f": Output((), (node.index,))}, ()), "f")
    by_hand = {
        "abs": abs,
        "step": lambda x: mpmath.mpf(x > 0),
        "min": lambda a, b: a if a < b else b,
        "max": lambda a, b: b if a < b else a,
        "select": lambda c, a, b: a if c > 0 else b,
    }
    for numbers in ((0.3, 0.7, 0.9), (0.7, -0.3, 0.2), (-0.7, 0.3, 0.2)):
        given = exact(numbers[:count])
        with mpmath.workdps(80):
            more = map(mpmath.mpf, given)
            expected = by_hand[name](*more) if name in by_hand else getattr(mpmath, name)(*more)
        if not isinstance(expected, mpmath.mpf):  # a complex number
            with pytest.raises((ArithmeticError, ValueError)):
                run(dict(zip("abc", given, strict=False)))
            continue
        for found in (*run(dict(zip("abc", given, strict=False))), Digits().call(name, *given)):
            assert isinstance(found, MP.mpf) and abs(found - expected) < 1e-59


@pytest.mark.parametrize("bits", (24, 53, 400))
def test_programs_in_sixty_digits(bits: int) -> None:
    """Sums, products and quotients keep their digits in any precision of the caller."""
    tape = Tape()
    x, three, tiny = tape.input("x", Stage.POSITIONS), tape.constant(3.0), tape.constant(1e-300)
    nodes = (-x / three, x * x * tiny, x / three - x * tape.constant(0.3))
    program = finish(tape, {"f": Output((3,), tuple(node.index for node in nodes))}, ())
    for value in (1.0, 3, MP.mpf(-2) / 7, MP.mpf(10) ** 40, MP.mpf(10) ** -400, 0.0):
        z = MP.mpf(value)
        with gmpy2.context(precision=bits):
            found = evaluator(program, "f")({"x": value})
        for a, b in zip(found, (-z / 3, z * z * 1e-300, z / 3 - z * 0.3), strict=True):
            assert abs(a - b) <= 1e-58 * abs(b)


def test_no_value_in_sixty_digits() -> None:
    """If an operation has no value, nor has the result, even if later operations would hide it."""
    tape = Tape()
    x, one = tape.input("x", Stage.POSITIONS), tape.constant(1.0)
    root = tape.apply("sqrt", x - one)
    for node in (one / (one / x), root / root, tape.apply("max", tape.apply("log", x), x)):
        program = finish(tape, {"f": Output((), (node.index,))}, ())
        with pytest.raises((ArithmeticError, ValueError)):
            evaluator(program, "f")({"x": 0.0})
