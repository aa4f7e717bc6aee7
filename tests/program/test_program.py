"""The straight-line program: folding, passes, the Jacobian transform, printing and names."""

import ast
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise, product
from math import cos, sin, sqrt
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from campaign import BUILT_IN
from engine import MP, text_of
from mechanisms import body, compiled, load, plane, random_tree
from spatial_newton_euler import solve
from spatial_trees import SpatialTree

from eomgen.codegen.from_equations import from_equations
from eomgen.codegen.system import optimised
from eomgen.program.differentiate import jacobian
from eomgen.program.extended import evaluator
from eomgen.program.ordering import ordered
from eomgen.program.passes import PASSES, optimise_and_report, parts_of
from eomgen.program.program import Output, Program, cost, finish, interpret, live_steps
from eomgen.program.tape import Node, Stage, Tape, power, total
from eomgen.scene.reader import parse_scene

TREES = (3, 9, 22, 7)


class DoubleScalars:
    """Doubles as scalars of a program."""

    def number(self, value: float) -> float:
        """The double itself."""
        return value

    def call(self, function: str, argument: float) -> float:
        """sin, cos, tan or sqrt, by `math`."""
        return getattr(math, function)(argument)


def fresh() -> tuple[Tape, Node, Node]:
    """A tape with two inputs."""
    tape = Tape()
    return tape, tape.input("x", Stage.POSITIONS), tape.input("y", Stage.VELOCITIES)


def same(a: Node, b: Node) -> bool:
    """Whether two nodes are one step of one tape."""
    return a.tape is b.tape and a.index == b.index


# Folding.


def test_folding() -> None:
    """What arithmetic makes trivial becomes no step: x + 0, 1·x, 0·x, x - x, x/1, 0/x, --x."""
    tape, x, y = fresh()
    zero, one = tape.constant(0.0), tape.constant(1.0)
    steps = len(tape.steps)
    for node in (x + zero, zero + x, x - zero, x * one, one * x, x / one):
        assert same(node, x)
    for node in (x * zero, zero * x, x - x, zero / x, -zero, tape.constant(-0.0)):
        assert same(node, zero)
    assert len(tape.steps) == steps
    minus = -x
    assert same(-minus, x)
    assert same(zero - x, minus)
    assert math.copysign(1.0, Tape().constant(-0.0).step.value) == 1.0
    assert same(total([], tape), zero)
    assert same(total([x, zero, y], tape), x + y)


def test_constants_fold() -> None:
    """Operations on numbers are done once and for all."""
    tape, _, _ = fresh()
    two, half = tape.constant(2.0), tape.constant(0.5)
    folded = {
        two + half: 2.5,
        two - half: 1.5,
        two * half: 1.0,
        half / two: 0.25,
        -two: -2.0,
        tape.apply("sqrt", two): math.sqrt(2.0),
        tape.apply("sin", half): math.sin(0.5),
        tape.apply("cos", half): math.cos(0.5),
        tape.apply("tan", half): math.tan(0.5),
        power(two, 10): 1024.0,
    }
    for node, value in folded.items():
        assert node.step.operation == "constant"
        assert node.step.value == value
        assert node.step.stage == Stage.CONSTANT


def test_interning() -> None:
    """What is written twice exists once; sums and products do not care about order."""
    tape, x, y = fresh()
    assert same(x * y, y * x)
    assert same(x + y, y + x)
    assert not same(x - y, y - x)
    assert not same(x / y, y / x)
    assert same(tape.apply("sin", x + y), tape.apply("sin", y + x))
    assert not same(tape.apply("sin", x), tape.apply("cos", x))
    assert same(tape.constant(3), tape.constant(3.0))
    assert same(tape.input("x", Stage.POSITIONS), x)
    assert same(power(x, 5), (x * x) * (x * x) * x)


def test_minus_moves_outwards() -> None:
    """A minus sign leaves products, quotients and odd functions, until a sum swallows it."""
    tape, x, y = fresh()
    minus_two = tape.constant(-2.0)
    assert same(-x * y, -(x * y))
    assert same(-x * -y, x * y)
    assert same(-x / y, -(x / y))
    assert same(x / -y, -(x / y))
    assert same(x * minus_two, -(x * tape.constant(2.0)))
    assert same(x / minus_two, -(x / tape.constant(2.0)))
    assert same(minus_two / x, -(tape.constant(2.0) / x))
    assert same(x + -y, x - y)
    assert same(-x + y, y - x)
    assert same(x - -y, x + y)
    assert same(-x - y, -(x + y))
    assert same(-(x - y), y - x)
    assert same(tape.apply("sin", -x), -tape.apply("sin", x))
    assert same(tape.apply("cos", -x), tape.apply("cos", x))


def test_folding_keeps_values() -> None:
    """Random expressions over few leaves, so that folds abound, keep their value."""
    rng = np.random.default_rng(51)
    binary: dict[str, Callable] = {
        "add": lambda a, b: a + b,
        "sub": lambda a, b: a - b,
        "mul": lambda a, b: a * b,
        "div": lambda a, b: a / b,
    }
    unary = {"neg": lambda a: -a, "sin": MP.sin, "cos": MP.cos}
    for _ in range(60):
        tape, x, y = fresh()
        inputs = {"x": MP.mpf("0.7"), "y": MP.mpf("-1.3")}
        pairs = [(x, inputs["x"]), (y, inputs["y"])]
        pairs += [(tape.constant(v), MP.mpf(v)) for v in (0.0, 1.0, -1.0, -2.0)]
        for _ in range(40):
            (a, va), (b, vb) = (pairs[i] for i in rng.integers(len(pairs), size=2))
            name = str(rng.choice([*binary, *unary]))
            if name in unary:
                pairs.append((tape.apply(name, a), unary[name](va)))
            elif (name != "div" or abs(vb) > 1e-3) and abs(va * vb) < 1e6:
                pairs.append((tape.apply(name, a, b), binary[name](va, vb)))
        nodes = tuple(node.index for node, _ in pairs)
        program = finish(tape, {"all": Output((len(nodes),), nodes)}, ())
        for value, (node, expected) in zip(evaluator(program, "all")(inputs), pairs, strict=True):
            # Constants fold in double precision.
            assert abs(value - expected) <= 1e-9 * (1 + abs(expected)), str(node.step)


def test_stages() -> None:
    """A step belongs to the latest of its operands' stages; constants are none's."""
    tape = Tape()
    p, q, v, u = (tape.input(stage.name, stage) for stage in list(Stage)[1:])
    assert (p * p).step.stage == Stage.PARAMETERS
    assert (p * q).step.stage == Stage.POSITIONS
    assert tape.apply("cos", p * q + v).step.stage == Stage.VELOCITIES
    assert (u / (v * v)).step.stage == Stage.INPUTS
    assert (tape.constant(2.0) * p).step.stage == Stage.PARAMETERS


def test_names_stay() -> None:
    """The first name suggested for a node is the one it keeps."""
    tape, x, y = fresh()
    tape.named(x * y, "area")
    tape.named(y * x, "product")
    assert tape.names == {(x * y).index: "area"}


# Passes, on the programs they really receive.


@cache
def lowered(case: str | int) -> Program:
    """The program of a scene as it comes to the passes."""
    scene = compiled(case if isinstance(case, str) else random_tree(case))
    system = from_equations(scene.equations)
    assert optimised(system).program == scene.system.program
    return system.program


def some_inputs(program: Program, rng: np.random.Generator) -> dict[str, Any]:
    """A value for every input of a program: positive ones, as masses must be."""
    names = [str(step.value) for step in program.steps if step.operation == "input"]
    return {name: MP.mpf(float(rng.uniform(0.3, 2.0))) for name in names}


@pytest.mark.every(8)
@pytest.mark.parametrize("case", [*BUILT_IN, *TREES])
def test_passes_keep_values_and_save_work(case: str | int) -> None:
    """After each pass every output has its value to 45 digits, and no more to do than before."""
    program = lowered(case)
    reports = compiled(case if isinstance(case, str) else random_tree(case)).system.reports
    names = [run.__name__.replace("_", " ") for run in PASSES]
    assert [report.name for report in reports] == ["as lowered", *names]
    rng = np.random.default_rng(52)
    inputs = some_inputs(program, rng)
    before = {o: evaluator(program, o)(inputs) for o in program.outputs}
    parts = parts_of(program)
    assert [o for part in parts for o in part.outputs] == list(before)
    for run, earlier, report in zip(PASSES, reports, reports[1:], strict=False):
        costs = [dict(part.operations) for part in parts]
        parts = [run(part) for part in parts]
        assert report.steps == sum(len(part.steps) for part in parts)
        for part, old in zip(parts, costs, strict=True):
            for output, count in old.items():
                assert cost(part, output)["total"] == part.operations[output] <= count
                if output in ("derivative", "jacobian"):
                    assert part.operations[output] == getattr(report, output)
                    assert count == getattr(earlier, output)
                values = evaluator(part, output)(inputs)
                for value, wanted in zip(values, before[output], strict=True):
                    assert abs(value - wanted) <= MP.mpf("1e-45") * (1 + abs(wanted))
    assert reports[-1].steps < reports[0].steps


@pytest.mark.parametrize("case", ["two_body_forced", TREES[-1]])
def test_programs_are_well_formed(case: str | int) -> None:
    """Steps use earlier steps only, none twice, none for nothing, at a stage not before theirs."""
    program = compiled(case if isinstance(case, str) else random_tree(case)).system.program
    for i, step in enumerate(program.steps):
        assert all(o < i for o in step.operands)
        assert all(program.steps[o].stage <= step.stage for o in step.operands)
    assert len(set(program.steps)) == len(program.steps)
    roots = [n for output in program.outputs.values() for n in output.nodes]
    roots += [check.node for check in program.checks]
    assert live_steps(program, roots) == list(range(len(program.steps)))
    for output in program.outputs.values():
        assert math.prod(output.shape) == len(output.nodes)


def test_factored_sums() -> None:
    """a·x ± a·y becomes a·(x ± y), but not where the products are needed elsewhere too."""
    tape, x, y = fresh()
    a, b = tape.input("a", Stage.INPUTS), tape.input("b", Stage.INPUTS)
    outputs = {
        "derivative": Output((3,), tuple(n.index for n in (a * x + y * a, a * x, a * y))),
        "jacobian": Output((2,), ((x * b - b * y).index, (b * b + a * b).index)),
    }
    better, reports = optimise_and_report(finish(tape, outputs, ()))
    assert reports[0].derivative == reports[-1].derivative == 3
    assert reports[0].jacobian == 6
    assert reports[-1].jacobian == 4  # (x - y)·b, (a + b)·b
    inputs = {"a": 3.0, "b": 2.0, "x": 5.0, "y": 7.0}
    assert interpret(better, "derivative", inputs, DoubleScalars()) == [36.0, 15.0, 21.0]
    assert interpret(better, "jacobian", inputs, DoubleScalars()) == [-4.0, 10.0]


def test_sums_that_go_on_are_factored() -> None:
    """(s ± a·x) ± a·y becomes s ± a·(x ± y) with all four signs; x ± y is free for parameters."""
    for first, second in product((1, -1), repeat=2):
        tape, *_ = fresh()
        a, s = tape.input("a", Stage.INPUTS), tape.input("s", Stage.INPUTS)
        k = [tape.input(name, Stage.PARAMETERS) for name in "kl"]
        once = s + a * k[0] if first > 0 else s - a * k[0]
        twice = once + a * k[1] if second > 0 else once - a * k[1]
        outputs = {
            "derivative": Output((1,), (twice.index,)),
            "other": Output((1,), ((a * k[0]).index,)),  # which keeps the derivative from nothing
        }
        better, reports = optimise_and_report(finish(tape, outputs, ()))
        assert (reports[0].derivative, reports[-1].derivative) == (4, 2)
        inputs = {"a": 3.0, "s": 2.0, "k": 5.0, "l": 7.0}
        (found,) = interpret(better, "derivative", inputs, DoubleScalars())
        assert found == 2.0 + first * 15.0 + second * 21.0


def test_absorbed_minus_signs() -> None:
    """-(x + k·y) becomes (-k)·y - x, with -k from parameters; not where k·y is needed elsewhere."""
    for shared in (False, True):
        tape, x, y = fresh()
        k = tape.input("k", Stage.PARAMETERS)
        entries = (-(x + k * y), -(x / k), *([k * y] * shared))
        outputs = {"derivative": Output((len(entries),), tuple(n.index for n in entries))}
        better, reports = optimise_and_report(finish(tape, outputs, ()))
        assert (reports[0].derivative, reports[-1].derivative) == (5, 4 if shared else 3)
        found = interpret(better, "derivative", {"k": 2.0, "x": 3.0, "y": 5.0}, DoubleScalars())
        assert found == [-13.0, -1.5, 10.0][: len(entries)]


def test_shared_factors() -> None:
    """a·(b·x) and a·(b·y) share a·b; a square is one factor, and a long product is no obstacle."""
    tape, x, y = fresh()
    a, b = tape.input("a", Stage.INPUTS), tape.input("b", Stage.INPUTS)
    long = x
    for _ in range(20):
        long = y * (x * long)
    inputs = {"a": 3.0, "b": 2.0, "x": 5.0, "y": 7.0}
    for nodes, count, expected in (
        ((a * (b * x), b * (a * y), a * (b * (x * x))), 5, [30.0, 42.0, 150.0]),
        ((long,), 40, [5.0 * 35.0**20]),
    ):
        outputs = {"derivative": Output((len(nodes),), tuple(node.index for node in nodes))}
        better, _ = optimise_and_report(finish(tape, outputs, ()))
        assert cost(better, "derivative")["total"] <= count
        found = interpret(better, "derivative", inputs, DoubleScalars())
        assert found == pytest.approx(expected, rel=1e-14)


# The Jacobian transform.


def call(function: str, x: Node) -> Node:
    """A function of a node."""
    return x.tape.apply(function, x)


@pytest.mark.parametrize(
    ("build", "slopes"),
    [
        (lambda x, y: x + y, lambda x, y: (1, 1)),
        (lambda x, y: x - y, lambda x, y: (1, -1)),
        (lambda x, y: x * y, lambda x, y: (y, x)),
        (lambda x, y: x * x, lambda x, y: (2 * x, 0)),
        (lambda x, y: x / y, lambda x, y: (1 / y, -x / y**2)),
        (lambda x, y: x / x * y, lambda x, y: (0, 1)),
        (lambda x, y: -(x * y), lambda x, y: (-y, -x)),
        (lambda x, y: call("sin", x * y), lambda x, y: (y * cos(x * y), x * cos(x * y))),
        (lambda x, y: call("cos", x * y), lambda x, y: (-y * sin(x * y), -x * sin(x * y))),
        (lambda x, y: call("tan", x + y), lambda x, y: (1 / cos(x + y) ** 2,) * 2),
        (lambda x, y: call("sqrt", x * y), lambda x, y: (sqrt(y / x) / 2, sqrt(x / y) / 2)),
        (lambda x, y: x.tape.constant(3.0) * x, lambda x, y: (3, 0)),
        (lambda x, y: x.tape.input("z", Stage.INPUTS) * x, lambda x, y: (0.25, 0)),
        (lambda x, y: y, lambda x, y: (0, 1)),
        (lambda x, y: x.tape.constant(7.0), lambda x, y: (0, 0)),
    ],
)
def test_jacobian_of_each_operation(build: Callable, slopes: Callable) -> None:
    """Every operation's derivative, by each of its operands, and the chain through them."""
    tape, x, y = fresh()
    [row] = jacobian([build(x, y)], [x, y])
    program = finish(tape, {"row": Output((2,), tuple(node.index for node in row))}, ())
    for a, b in ((0.6, 1.7), (1.1, 0.4)):
        values = interpret(program, "row", {"x": a, "y": b, "z": 0.25}, DoubleScalars())
        assert values == pytest.approx([float(s) for s in slopes(a, b)], rel=1e-14, abs=1e-14)


def test_jacobian_knows_every_operation() -> None:
    """An operation without a known derivative is a fault of this program, never a silent 0."""
    tape, x, y = fresh()
    odd = tape.apply("cosh", x)
    with pytest.raises(AssertionError, match="cosh"):
        jacobian([odd], [x])
    assert jacobian([], [x, y]) == []


# Printing.


@pytest.mark.every(2)
@pytest.mark.parametrize("case", [*BUILT_IN, *TREES])
def test_printed_code_is_the_program(case: str | int) -> None:
    """Scalar code does the program's operations in the program's order: equal to the last bit."""
    c = compiled(case if isinstance(case, str) else random_tree(case))
    rng = np.random.default_rng(53)
    for _ in range(50):
        y, u = c.random_state(rng), c.random_inputs(rng)
        inputs = {**c.module.PARAMETERS, **dict(zip(c.module.STATES, y.tolist(), strict=True)), **u}
        for output in ("derivative", "jacobian", "joint_forces", "momentum", "mass_matrix"):
            ours = getattr(c.module, output)(0.0, y, u=u)
            assert ours.ravel().tolist() == interpret(
                c.system.program, output, inputs, DoubleScalars()
            )


def test_columns_are_the_same_code() -> None:
    """Columns of states give each state's own values, but for NumPy's own sine and cosine."""
    c, rng = compiled("two_body_forced"), np.random.default_rng(54)
    columns = np.array([c.random_state(rng) for _ in range(7)]).T
    u = c.random_inputs(rng)
    for name in c.system.program.outputs:
        if name in ("initial_state", "forward_dynamics", "inverse_dynamics"):
            continue
        function = getattr(c.module, name)
        together = function(0.0, columns, u=u)
        apart = np.stack([function(0.0, y, u=u) for y in columns.T], axis=-1)
        assert together.shape == apart.shape
        assert np.allclose(together, apart, rtol=1e-13, atol=1e-13)
    q, v = columns[:4], columns[4:]
    tau = rng.uniform(-5.0, 5.0, (4, 7))
    for function in (c.module.forward_dynamics, c.module.inverse_dynamics):
        apart = [function(q[:, i], v[:, i], tau[:, i], u=u) for i in range(7)]
        assert np.allclose(function(q, v, tau, u=u), np.transpose(apart), rtol=1e-12, atol=1e-12)
        one = [function(q[:, i], v[:, i], tau[:, 0], u=u) for i in range(7)]
        assert np.allclose(
            function(q, v, tau[:, 0], u=u), np.transpose(one), rtol=1e-12, atol=1e-12
        )


def test_counted_operations_are_the_printed_ones() -> None:
    """COST counts what the module's own text does: as many operators and calls as it says."""
    c = compiled("two_body_forced")
    tree = ast.parse(c.source)
    functions = {f.name: f for f in tree.body if isinstance(f, ast.FunctionDef)}
    for name in c.system.program.outputs:
        function = functions[f"_{name}"]
        counts = dict.fromkeys(c.module.COST[name], 0)
        for node in ast.walk(ast.Module(function.body, [])):
            match node:
                case ast.BinOp(op=op):
                    counts[type(op).__name__.lower().replace("mult", "mul")] += 1
                case ast.Call(func=ast.Name(id=called)):
                    counts[called] += 1
                case ast.UnaryOp(operand=operand) if not isinstance(operand, ast.Constant):
                    counts["neg"] += 1
        counts["total"] = sum(counts.values())
        counts["parameters"] = c.module.COST[name]["parameters"]
        assert counts == c.module.COST[name]


# Names.


def chain(bodies: list[str], joints: list[str], words: list[str]) -> tuple[str, SpatialTree]:
    """A chain on the world whose parameters go by the given words, and the same in numbers."""
    n = len(bodies)
    value = {word: 0.4 + 0.1 * i for i, word in enumerate(words)}
    mass, inertia, inner, outer = (words[i * n : (i + 1) * n] for i in range(4))
    gravity = words[4 * n]
    text = 'name = "awkward"\noutputs = "all"\n[parameters]\n'
    text += "".join(f"{word} = {x!r}\n" for word, x in value.items())
    for k, name in enumerate(bodies):
        parent = "world" if k == 0 else bodies[k - 1]
        text += f"""
[[bodies]]
name = "{name}"
mass = "{mass[k]}"
inertia_com = "{inertia[k]}"
[[joints]]
name = "j{k}"
type = "revolute"
parent = "{parent}"
child = "{name}"
coordinate = "{joints[k]}"
r_parent = ["{inner[k]}", 0]
r_child = ["-{outer[k]}", 0]
"""
    text += f'[[effects]]\ntype = "gravity"\ng = "{gravity}"\n'
    m, moments, at, on = (
        [value[word] for word in words] for words in (mass, inertia, inner, outer)
    )
    tree = [
        body(bodies[k], m[k], moments[k], joints[k], f"j{k}", (at[k], -on[k]), parent=k - 1)
        for k in range(n)
    ]
    return text, plane(tree, value[gravity], value)


AWKWARD = {
    "words the module uses": (
        "y p u k extra np math sin cos tan sqrt values float len zip ValueError tuple",
        "list x hasattr",
    ),
    "names the printer makes": (
        "s1 s2 s3 k1 k2 k3 sin_s4 cos_x sin_x x_dot_squared pivot_A alpha_A load_A load_B",
        "x s4 x2",
    ),
    "names of its functions": (
        "derivative jacobian momentum NAME STATES INPUTS isfinite lru_cache E I S N O Q",
        "lambda_x e c",
    ),
    "letters and underscores": (
        "beta gamma zeta pi2 x_y_z q v a tau_x f_x omega_A angle_A x_A y_A x_A_dot A B",
        "theta phi t1",
    ),
}


@pytest.mark.parametrize("kind", AWKWARD)
@pytest.mark.every(4)
def test_awkward_names(kind: str) -> None:
    """A scene may call its quantities as it likes: the module means what the scene says."""
    words, joints = (text.split() for text in AWKWARD[kind])
    assert len(set(words)) == len(words) in range(9, 19)
    for chosen, coordinates in ((words[:9], joints[:2]), (words[-9:][::-1], joints[-2:])):
        text, tree = chain(["A", "B"], coordinates, chosen)
        module = assert_module_is(text, tree, coordinates)
        for name, mass in zip("AB", chosen, strict=False):
            with pytest.raises(ValueError, match=f"^mass of {name} is not positive: change the"):
                module.derivative(0.0, np.zeros(4), {mass: -1.0})


@pytest.mark.parametrize(
    "bodies", ["A A_dot A_ddot", "B_A A A_B", "derivative np", "x y", "A_0 A_0_1 A"]
)
@pytest.mark.every(4)
def test_awkward_bodies(bodies: str) -> None:
    """Bodies whose names read like one another's symbols put together are kept apart."""
    names = bodies.split()
    joints = [f"q{k}" for k in range(len(names))]
    text, tree = chain(names, joints, [f"p{k}" for k in range(4 * len(names) + 1)])
    assert_module_is(text, tree, joints)


def assert_module_is(text: str, tree: SpatialTree, joints: list[str]) -> ModuleType:
    """The module of a scene, executed, against the independent solver and its energies."""
    module = load(text_of(parse_scene(text)))
    assert list(module.STATES) == [*joints, *(f"{joint}_dot" for joint in joints)]
    rng, n = np.random.default_rng(55), len(joints)
    for _ in range(5):
        y = rng.uniform(-3.0, 3.0, 2 * n)
        motion = solve(tree, y[:n], y[n:])
        scale = np.max(np.abs(motion.accelerations))
        rates = module.derivative(0.0, y)[n:]
        assert np.max(np.abs(rates - motion.accelerations)) <= 1e-12 * scale
        columns = module.derivative(0.0, np.column_stack((y, y)))[n:, 1]
        assert np.max(np.abs(columns - motion.accelerations)) <= 1e-12 * scale
        forces = module.joint_forces(0.0, y)
        assert np.allclose(forces, motion.joint_forces, rtol=1e-11, atol=1e-11)
        assert module.kinetic_energy(0.0, y) == pytest.approx(motion.kinetic_energy, rel=1e-12)
        potential = module.potential_energy(0.0, y)
        assert potential == pytest.approx(motion.potential_energy, rel=1e-12)
        assert np.array_equal(
            module.derivative(0.0, y, dict(module.PARAMETERS)), module.derivative(0.0, y)
        )
    return module


# Formulas.


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("l/3 + 1/8", lambda r: r / 3 + 1 / 8),
        ("-sin(l)*cos(2*l)", lambda r: -sin(r) * cos(2 * r)),
        ("sin(l)/cos(l) - tan(l/2)", lambda r: math.tan(r) - math.tan(r / 2)),
        ("sqrt(l**3)", lambda r: sqrt(r**3)),
        ("sqrt(l**2)", abs),
        ("pi*l/4 + 1e-3", lambda r: math.pi * r / 4 + 1e-3),
    ],
)
def test_formulas(formula: str, value: Callable[[float], float]) -> None:
    """Every formula of the scene language reaches the module with its value, for any parameters."""
    text = f"""
    name = "formula"
    parameters = {{ l = 0.3 }}
    bodies = [{{ name = "A", mass = 2.0, inertia_com = 0.1 }}]
    effects = [{{ type = "gravity", g = 9.81 }}]
    [[joints]]
    name = "a"
    type = "revolute"
    parent = "world"
    child = "A"
    r_child = [0.5, "{formula}"]
    """
    module = load(text_of(parse_scene(text)))
    y = np.array([0.4, 1.2])
    for length in (0.3, 1.1):
        bob = body("A", 2.0, 0.1, "a_angle", "a", (0.0, 0.5))
        bob = replace(bob, joint=replace(bob.joint, r_child=(0.5, value(length), 0.0)))
        expected = solve(plane((bob,), 9.81, {}), y[:1], y[1:]).accelerations[0]
        assert module.derivative(0.0, y, {"l": length})[1] == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("ratio", [1e-6, 1e-3, 1.0, 1e3, 1e6])
def test_digits_at_mass_ratios(ratio: float) -> None:
    """Accelerations and joint forces keep their digits whichever of the two bodies is heavy.

    The same program in 60 digits is the reference, so what is measured is rounding alone.
    """
    c = compiled("two_body")
    rng = np.random.default_rng(17)
    p = dict(c.module.PARAMETERS)
    p["m_A"], p["I_A"] = ratio * p["m_A"], ratio * p["I_A"]
    for _ in range(40):
        y = rng.uniform(-3.0, 3.0, len(c.module.STATES))
        inputs = {**p, **dict(zip(c.module.STATES, y, strict=True))}
        exact = {name: MP.mpf(float(value)) for name, value in inputs.items()}
        for output in ("derivative", "joint_forces"):
            values = evaluator(c.system.program, output)(exact)
            expected = np.array([float(value) for value in values])
            actual = np.ravel(getattr(c.module, output)(0.0, y, p))
            assert np.max(np.abs(actual - expected)) <= 1e-13 * np.max(np.abs(expected))


def test_an_order_for_registers_and_short_waits() -> None:
    """A long sum takes up what was computed for it at once; two long chains advance together. The
    steps are the same, operands come before what uses them, and results keep their bits.
    """
    tape, x, y = fresh()
    terms = [(x + tape.constant(i)) * y for i in range(100)]
    one, other = x, y
    for i in range(100):
        one = one * x + tape.constant(i)
    for i in range(100):
        other = other * y + tape.constant(i)
    nodes = (total(terms, tape).index, (one / other).index)
    program = finish(tape, {"f": Output((2,), nodes)}, [])
    made = ordered(program)
    before, after = (Counter(s.operation for s in p.steps if s.operands) for p in (program, made))
    assert before == after
    assert all(o < i for i, step in enumerate(made.steps) for o in step.operands)
    given = {"x": 0.3, "y": -0.7}
    results = [interpret(p, "f", given, DoubleScalars()) for p in (program, made)]
    assert results[0] == results[1]
    assert most_in_use(program) > 100 and most_in_use(made) < 70
    of_y = [step.stage is Stage.VELOCITIES for step in made.steps if step.operation == "mul"]
    changes = sum(a != b for a, b in pairwise(of_y[100:]))
    assert changes > 50, "the two chains are not interleaved"


def most_in_use(program: Program) -> int:
    """The largest number of computed values that wait for a use."""
    last = {o: i for i, step in enumerate(program.steps) for o in step.operands}
    computed = [i for i, step in enumerate(program.steps) if step.operands]
    ends = Counter(last.get(i, len(program.steps)) for i in computed)
    in_use = most = 0
    for i in range(len(program.steps)):
        in_use += bool(program.steps[i].operands) - ends[i]
        most = max(most, in_use)
    return most
