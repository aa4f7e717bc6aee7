"""What a module is given: taken exactly as it is, or refused in one line; never half understood."""

import math
import re
from collections.abc import Callable
from fractions import Fraction
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from campaign import some
from engine import MP, engine, quick

from eomgen.language.formula import Constant, Formula, evaluate, parse
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import compile_program, python_module
from eomgen.program.tape import Tape
from eomgen.run.integrate import integrate
from eomgen.run.module import load_module
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.reader import parse_scene
from eomgen.study.diagnosis import problem_of

TURNED = """
name = "turned"
parameters = {{ a = {a}, b = 0.0 }}
bodies = [{{ name = "bob", mass = 1.0, inertia_com = 0.1 }}]
joints = [{{ name = "pivot", type = "revolute", parent = "world", child = "bob", r_child = [-1.0, 0] }}]
effects = [{{ type = "motor", name = "tq", joint = "pivot", torque = "{torque}" }}]
"""  # noqa: E501
STILL = np.zeros(2)


# Values that are equal and compute differently: no table of the program takes one for the other.


@pytest.mark.parametrize("order", list(permutations([0.0, -0.0, 1.0])))
def test_answers_do_not_depend_on_earlier_calls(order: tuple[float, ...]) -> None:
    """atan2 distinguishes 0.0 from -0.0, though they are equal: so does what keeps constants by
    value.
    """
    source = quick(TURNED.format(a=1.0, torque="atan2(b, a)")).source
    module = load_module(source)
    for a in order:
        ordered = [*{**module.PARAMETERS, "a": a}.values()]
        for p in ({"a": a}, ordered, np.array(ordered)):
            torque = module.derivative(0.0, STILL, p)[1] * 1.1
            assert torque == pytest.approx(math.atan2(0.0, a), abs=1e-15), (order, a)


def test_whole_numbers_and_truths_are_the_numbers_that_they_are() -> None:
    """1, True and 1.0 are one key of a table: whichever comes first, all give a float's answer."""
    module = load_module(quick(TURNED.format(a=2.0, torque="a*atan2(1, a)")).source)
    wanted = module.derivative(0.0, STILL, {"a": 1.0})
    for a in (1, True, np.int8(1), np.float32(1.0), np.True_, 1.0):
        found = module.derivative(0.0, STILL, {"a": a})
        assert found.dtype == np.float64
        assert found.tolist() == wanted.tolist()


@pytest.mark.parametrize("route", ["closed", "aba"])
def test_zeros_of_a_scene_have_no_sign(route: str) -> None:
    """Formulas that differ in the sign of a zero are equal: so they mean the same, in any order."""
    assert Constant(-0.0) == Constant(0.0)
    assert math.copysign(1.0, Constant(-0.0).value) == 1.0
    for zeros in permutations(["-0.0", "0.0", "-(0)", "a"]):
        torques = [f"atan2(b, {zero})" for zero in zeros]
        scene = parse_scene(TURNED.format(a=-0.0, torque=" + ".join(torques)))
        model = elaborate(scene.replaced(route=route))
        assert math.copysign(1.0, model.defaults["a"]) == 1.0
        module = load_module(python_module(compile_program(model, jacobian=False).system))
        assert module.derivative(0.0, STILL)[1] == 0.0
    assert evaluate(parse("atan2(b, -0.0)"), {"b": 0.0}, FloatScalars()) == 0.0


def test_constants_of_a_tape_and_of_formulas_are_floats() -> None:
    """What interns numbers by value interns floats alone."""
    tape = Tape()
    one = [tape.constant(x) for x in (1, True, 1.0)]
    assert {node.index for node in one} == {one[0].index}
    assert type(one[0].step.value) is float
    found: list[Formula] = [Constant(1), Constant(True), Constant(1.0)]
    assert {type(x.value) for x in found if isinstance(x, Constant)} == {float}


# What is converted exactly, and what is refused.


SPUN = """
name = "spun"
dimensions = 3
bodies = [
    { name = "top", mass = 1.5, inertia_com = [0.2, 0.3, 0.4] },
    { name = "bead", mass = 0.5, inertia_com = 0 },
]
joints = [
    { name = "tip", type = "ball", parent = "world", child = "top", r_child = [0.1, 0, -0.5] },
    { name = "rod", type = "prismatic", parent = "top", child = "bead", axis = [1, 0, 0], coordinate = "x", r_parent = [0, 0, 0.3] },
]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "joint_spring", name = "hold", joint = "rod", stiffness = 5.0 },
    { type = "motor", name = "pull", joint = "rod", torque = "input" },
    { type = "motor", name = "shake", joint = "rod", torque = "sin(3*t)" },
    { type = "joint_friction", name = "rub", joint = "rod", viscous = 0.1, coulomb = 0.2, speed = 0.01 },
]
"""  # noqa: E501
"""A quaternion, a slide, an input, a formula of time, friction: what a shell has to do with."""
RIGHT = [0.9, -0.1, 0.3, 0.2, 0.4, 1.0, -0.5, 0.3, 0.2]
EXACT: list[tuple[str, Callable[[np.ndarray], Any]]] = [
    ("list", lambda y: y.tolist()),
    ("tuple", lambda y: tuple(y.tolist())),
    ("not contiguous", lambda y: np.repeat(y, 3, axis=0)[::3]),
    ("backwards", lambda y: np.ascontiguousarray(y[::-1])[::-1]),
    ("other byte order", lambda y: y.astype(y.dtype.newbyteorder())),
    ("read only", lambda y: np.frombuffer(y.tobytes()).reshape(y.shape)),
    ("nothing masked", np.ma.array),
    ("a class of its own", lambda y: y.view(type("Own", (np.ndarray,), {}))),
    ("objects with __array__", lambda y: type("Like", (), {"__array__": lambda *_, **__: y})()),
]
REFUSED: list[tuple[str, Callable[[np.ndarray], Any], str]] = [
    ("long double", lambda y: y.astype(np.longdouble), "of type .*; convert to float"),
    ("complex", lambda y: y + 0j, "of type complex128; convert to float"),
    ("objects", lambda y: y.astype(object), "of type object; convert to float"),
    ("fractions", lambda y: [*map(Fraction, y.ravel())], "of type object; convert to float"),
    ("text", lambda y: y.astype(str), "of type str.*; convert to float"),
    ("None", lambda y: None if y.ndim == 2 else [None, *y[1:]], "of type object; conv"),
    ("masked", lambda y: np.ma.masked_less(y, 0.0), "some are masked; leave those out"),
    ("ragged", lambda y: [y.tolist(), 1.0], "not an array: its rows differ in length"),
    ("huge integers", lambda y: np.full(y.shape, 2**53 + 1), r"has whole numbers beyond 2\*\*53"),
    ("dates", lambda y: np.full(y.shape, np.datetime64(1, "s")), "of type datetime64"),
    ("records", lambda y: np.zeros(y.shape, "f8,f8"), "of type void128; convert"),
]
if np.dtype(np.longdouble).itemsize == 8:  # where it is a float by another name
    REFUSED = REFUSED[1:]


@pytest.fixture(scope="module")
def spun() -> Any:
    """The module of `SPUN`."""
    return quick(SPUN).module


def outputs(module: Any, y: Any, t: Any = 0.2, p: Any = None, u: Any = None) -> dict[str, Any]:
    """Every function of a module at a state or columns, or the error that it raises."""
    nq, nv = len(module.POSITIONS), len(module.STATES) - len(module.POSITIONS)
    found: dict[str, Any] = {}
    for name in module.COST:
        function = getattr(module, name)
        try:
            if name == "initial_state":
                continue
            if name in ("forward_dynamics", "inverse_dynamics"):
                found[name] = function(y[:nq], y[nq:], np.ones(nv), t, p, u)
            else:
                found[name] = function(t, y, p, u)
        except (ArithmeticError, ValueError, TypeError) as error:
            found[name] = error
    return found


@pytest.mark.parametrize("columns", [False, True])
@pytest.mark.parametrize(("kind", "make"), EXACT)
def test_what_is_exactly_a_float_is_taken(
    spun: Any, kind: str, make: Callable[[np.ndarray], Any], columns: bool
) -> None:
    """As one state and as columns, for states and for parameters: the same bits."""
    y = np.array(RIGHT)
    y = np.array([y, 2 * y, -y]).T if columns else y
    for name in ("derivative", "jacobian", "kinetic_energy", "body_poses"):
        function = getattr(spun, name)
        wanted, found = function(0.2, y), function(0.2, make(y))
        assert found.dtype == np.float64 and found.shape == wanted.shape
        assert found.tobytes() == wanted.tobytes(), name
    p, u = np.array([*spun.PARAMETERS.values()]) * 1.1, np.array([2.5])
    wanted = spun.derivative(0.2, y, p, u)
    assert spun.derivative(0.2, y, make(p), make(u)).tobytes() == wanted.tobytes()


def test_small_floats_and_integers_are_floats(spun: Any) -> None:
    """What loses no bit: halves, singles, integers of any width, truths; as t, too."""
    for dtype in (np.float16, np.float32, np.int8, np.int64, np.uint16, np.bool_):
        given = np.array([1, 0, 1, 1, 0, 1, 1, 0, 1]).astype(dtype)
        wanted = spun.derivative(1.0, given.astype(float))
        for y in (given, given.tolist(), np.array([given]).T):
            assert spun.derivative(dtype(1), y).ravel().tobytes() == wanted.tobytes()
        assert spun.derivative(1, given).dtype == np.float64


@pytest.mark.parametrize("columns", [False, True])
@pytest.mark.parametrize(("kind", "make", "why"), REFUSED)
def test_what_is_no_float_is_refused(
    spun: Any, kind: str, make: Callable[[np.ndarray], Any], why: str, columns: bool
) -> None:
    """In one line, by every function, as a state, columns, parameters, inputs, forces, time."""
    y = np.array([RIGHT, RIGHT]).T if columns else np.array(RIGHT)
    bad = make(y)
    for name in spun.COST:
        if name not in ("initial_state", "forward_dynamics", "inverse_dynamics"):
            with pytest.raises(ValueError, match=f"^y: {why}"):
                getattr(spun, name)(0.0, bad)
    q, v = y[:5], y[5:]
    wrong = make(v)
    with pytest.raises(ValueError, match=f"^tau: {why}"):
        spun.forward_dynamics(q, v, [None] if wrong is None else wrong)
    with pytest.raises(ValueError, match=f"^v: {why}"):
        spun.forward_dynamics(q, wrong)
    p = make(np.array([-1.0, *list(spun.PARAMETERS.values())[1:]]))
    with pytest.raises(ValueError, match=f"^parameters: {why}"):
        spun.derivative(0.0, y, p)
    with pytest.raises(ValueError, match=f"^inputs: {why}"):
        spun.derivative(0.0, y, None, make(np.array([-1.0])))
    if kind not in ("ragged", "fractions", "None"):
        with pytest.raises(ValueError, match=f"^t: {why}"):
            spun.derivative(make(np.array(-1.0)), y)


def test_times_of_columns(spun: Any) -> None:
    """One for all, or one each; no other number of them."""
    y, t = np.array([RIGHT, RIGHT, RIGHT]).T, np.array([0.1, 0.2, 0.3])
    together = spun.derivative(t, y)
    for k in range(3):
        assert together[:, k] == pytest.approx(spun.derivative(t[k], y[:, k]), rel=1e-14)
    with pytest.raises(ValueError, match=r"^t has shape \(2,\), not \(\)"):
        spun.derivative(t[:2], y)
    with pytest.raises(ValueError, match=r"^t has shape \(3,\), not \(\)"):
        spun.derivative(t, y[:, 0])


# States that have no answer.


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_state_that_is_not_finite_is_named(spun: Any, bad: float) -> None:
    """By every function, wherever it stands; among columns its own results are nan, and only they.

    An array takes the short way through `derivative`, a list the long one: they say the same.
    """
    rng = np.random.default_rng(3)
    others = np.array(RIGHT)[:, None] * rng.uniform(0.5, 1.0, (len(RIGHT), 4))
    for i, state in enumerate(spun.STATES):
        y = np.array(RIGHT)
        y[i] = bad
        message = f"state '{state}' is {bad}, not a finite number"
        for name, found in outputs(spun, y).items():
            assert isinstance(found, ValueError) and str(found) == f"{name}: {message}"
        with pytest.raises(ValueError, match=f"^derivative: {message}$"):
            spun.derivative(0.0, y.tolist())
        columns = others.copy()
        columns[:, 2] = y
        good, mixed = outputs(spun, others), outputs(spun, columns)
        for name, found in mixed.items():
            assert np.isnan(found[..., 2]).all(), name
            for k in (0, 1, 3):
                assert found[..., k].tobytes() == good[name][..., k].tobytes(), name


def test_what_is_given_beside_a_state_is_finite(spun: Any) -> None:
    """Forces, times and inputs; of columns, each its own."""
    q, v = np.array(RIGHT[:5]), np.array(RIGHT[5:])
    with pytest.raises(ValueError, match=r"^tau has a number that is not finite$"):
        spun.forward_dynamics(q, v, [0.0, 1.0, math.nan, 0.0])
    for bad in (math.nan, math.inf):
        with pytest.raises(ValueError, match=f"^t is {bad}, not a finite number$"):
            spun.derivative(bad, np.array(RIGHT))
        y, u, t = np.array([RIGHT, RIGHT]).T, np.array([[1.0, bad]]), np.array([0.1, bad])
        for found in (spun.derivative(0.1, y, None, u), spun.derivative(t, y)):
            assert np.isfinite(found[:, 0]).all() and np.isnan(found[:, 1]).all()


def test_the_length_of_a_quaternion(spun: Any) -> None:
    """No length changes the answer, or else it is refused, by name, with what to do."""
    y = np.array(RIGHT)
    y[:4] /= np.linalg.norm(y[:4])
    wanted = outputs(spun, y)
    refused = 0
    for power in range(-320, 309, 4):
        long = np.concatenate((y[:4] * 10.0**power, y[4:]))
        columns = outputs(spun, np.array([y, long]).T)
        for name, found in outputs(spun, long).items():
            if name in ("derivative", "jacobian"):
                continue  # they hold the quaternion's own rate, which grows with it
            if isinstance(found, Exception):
                refused += 1
                assert isinstance(found, ValueError)
                assert str(found).startswith(
                    f"{name}: the quaternion that starts at 'tip_qw' has length "
                )
                assert str(found).endswith("; scale it to 1")
                assert np.isnan(columns[name][..., 1]).all()
                assert not 1e-100 < 10.0**power < 1e100
            else:
                assert found == pytest.approx(wanted[name], rel=1e-12, abs=1e-12), (name, power)
                assert columns[name][..., 1] == pytest.approx(found, rel=1e-12, abs=1e-12)
    assert refused > 100
    zero = np.array([0.0] * 4 + RIGHT[4:])
    with pytest.raises(
        ValueError, match=r"^derivative: the quaternion that starts at 'tip_qw' has leng"
    ):
        spun.derivative(0.0, zero)


def test_nothing_is_silently_wrong_far_away() -> None:
    """One or two states of any size: right against 60 digits, or refused; alone, among columns."""
    cases = (SPUN, "two_body_forced", "cart_pole", "spinning_top")
    cases += some((), ("furuta_pendulum", "puma560"))
    without = ("jacobian", "input_jacobian", "parameter_jacobian")
    rng = np.random.default_rng(11)
    right = refused = 0
    for scene in cases:
        made = engine(scene, leave_out=without)
        module = made.module
        states = []
        for _ in range(some(20, 40)):
            y = made.random_state(rng)
            for i in rng.integers(len(y), size=2):
                # An angle that is added to another loses its digits where both are doubles.
                most = 3 if module.UNITS[module.STATES[i]] == "rad" else 308
                y[i] = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(1, most)
            states.append(y)
        for name in ("derivative", "mass_matrix", "kinetic_energy"):
            columns = getattr(module, name)(0.2, np.array(states).T)
            for k, y in enumerate(states):
                try:
                    found = np.asarray(getattr(module, name)(0.2, y))
                except (ArithmeticError, ValueError):
                    refused += 1
                    assert np.isnan(columns[..., k]).all(), (scene, name, y)
                    continue
                true = made.exactly(name, [MP.mpf(x) for x in y], t=0.2).astype(object)
                size = max((abs(x) for x in true.ravel()), default=0)
                pairs = zip(found.ravel(), true.ravel(), strict=True)
                error = max(abs(MP.mpf(a) - b) for a, b in pairs)
                right += 1
                assert error <= 1e-9 * size, (scene, name, y.tolist(), found, true)
                together = np.asarray(columns[..., k])
                assert np.allclose(together, found, rtol=1e-9, atol=1e-9 * float(size))
    assert min(right, refused) > some(60, 100)


def test_parameters_far_away() -> None:
    """In units of mass and length of any size: right against 60 digits, or refused with the sizes.

    One unit for all: masses that differ by many decades take digits by themselves.
    """
    rng = np.random.default_rng(12)
    powers = {"kg": (1, 0), "m": (0, 1), "kg m^2": (1, 2), "m/s^2": (0, 1), "m/s": (0, 1)}
    right = refused = 0
    scenes = ("double_pendulum", "cart_pole", "tumbling_body")
    for scene in scenes + some((), ("pendulum", "spinning_top")):
        made = quick(scene)
        units = made.module.UNITS
        for _ in range(some(40, 100)):
            kg, m = 10.0 ** rng.uniform(-160, 100, size=2)
            factors = {unit: float(kg**mass * m**length) for unit, (mass, length) in powers.items()}
            factor = {name: factors.get(unit, 1.0) for name, unit in units.items()}
            y = made.random_state(rng) * [factor[name] for name in made.module.STATES]
            p = {name: x * factor[name] for name, x in made.module.PARAMETERS.items()}
            try:
                found = made.module.derivative(0.0, y, p)
            except (ArithmeticError, ValueError) as error:
                refused += 1
                far = [name for name, x in p.items() if not 1e-50 < abs(x) < 1e50]
                at_state = str(error).startswith("derivative: ")
                assert far and (at_state or any(name in str(error) for name in far)), error
                continue
            true = made.exactly("derivative", [MP.mpf(x) for x in y], p=p)
            for unit in {units[name] for name in made.module.STATES}:  # a scale of its own for each
                own = [i for i, name in enumerate(made.module.STATES) if units[name] == unit]
                error = max(abs(MP.mpf(found[i]) - true[i]) for i in own)
                assert error <= 1e-9 * max(abs(true[i]) for i in own), (scene, p, found, true)
            right += 1
    assert right > some(50, 100) and refused > some(25, 50)
    made = quick("pendulum")
    message = "parameter 'bob_mass' is 1e+300, larger than 1e+100; choose other units"
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        made.module.derivative(0.0, np.zeros(2), {"bob_mass": 1e300})


def test_a_step_far_too_long_is_tried_again() -> None:
    """A method's own trial state may be one that no float can serve: the step is rejected."""
    text = TURNED.format(a=1.0, torque="-1000*(pivot_angle*1000)**15")
    made = quick(text + "initial = { v = [10.0] }\n")
    module, refused = load_module(made.source), []
    derivative = module.derivative

    def noted(*given: Any) -> np.ndarray:
        try:
            return derivative(*given)
        except FloatingPointError:
            refused.append(given)
            raise

    module.derivative = noted
    for p in (None, {"a": 1.0}):
        run = integrate(problem_of(module, p, model=made.model), "RK45", 0.005, rtol=1e-3)
        assert run.finished and refused, run.message
        refused.clear()
