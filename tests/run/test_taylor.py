"""Taylor series: their coefficients against the program itself, runs against extended precision."""

import math
import shutil
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from languages import Given, results
from smooth_program import START, STATES, VALUES, everything

import eomgen
from eomgen.base.errors import RunError
from eomgen.base.loading import load_source
from eomgen.engine import adaptive, sums
from eomgen.engine import taylor as engine
from eomgen.engine.taylor import expanded
from eomgen.model.elaborate import elaborate
from eomgen.native import taylor
from eomgen.native.library import compiled_library
from eomgen.program.program import Output, Program, finish, interpret
from eomgen.program.tape import FUNCTIONS, TIME, Stage, Tape
from eomgen.program.taylor import (
    NoSeriesError,
    Quotient,
    Recurrences,
    Root,
    Solution,
    Sum,
    Term,
    recurrences,
)
from eomgen.program.taylor_text import series_text
from eomgen.run.module import load_module
from eomgen.scalars.extended import Digits
from eomgen.scene.reader import read_scene
from eomgen.store import generated_code
from eomgen.study.accuracy.measure import error
from eomgen.study.accuracy.reference import reference
from eomgen.study.precision.precise import digits
from eomgen.subset.text import Text

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
compiler = pytest.mark.skipif(CC is None, reason="there is no C compiler")
ORDER, LATER = 12, 1e-3
DRIVEN = """
name = "driven"
dimensions = 2
bodies = [{ name = "bead", mass = 2.0, inertia_com = 0 }]
effects = [{ type = "motor", name = "push", joint = "wire", torque = "3*cos(2*t)" }]
initial = { q = [0.1], v = [0.2] }
[[joints]]
name = "wire"
type = "prismatic"
parent = "world"
child = "bead"
axis = [1, 0]
coordinate = "x"
"""


def residual(program: Program, system: Recurrences) -> float:
    """By how much the polynomial misses y' = f(t, y) a little later, in extended precision."""
    with digits():
        scalars = Digits()
        values = {name: scalars.number(x) for name, x in VALUES.items()}
        fixed = {i: _fixed(program, i, values) for i in system.fixed}
        start = {name: scalars.number(x) for name, x in START.items()}
        t, h = scalars.number(0.5), scalars.number(LATER)
        rows = coefficients(system, fixed, t, start, scalars)
        at = {n: sum(row[j] * h**k for k, row in enumerate(rows)) for j, n in enumerate(STATES)}
        slopes = interpret(program, "derivative", {**values, **at, TIME: t + h}, scalars)
        terms = [(k * h ** (k - 1), row) for k, row in enumerate(rows) if k]
        there = [sum(factor * row[j] for factor, row in terms) for j in range(4)]
        return max(float(abs(x - y)) for x, y in zip(slopes, there, strict=True))


class Exactly(taylor.InPython):
    """Recurrences whose fractions have all digits, too."""

    def extended(self, k: int, *others: Any) -> None:
        super().extended(Digits().number(k), *others)


def coefficients(
    system: Recurrences, fixed: dict[int, Any], t: Any, y: dict[str, Any], scalars: Digits
) -> Any:
    """The Taylor coefficients (ORDER + 1, ny) of a solution, by the text that all places have."""
    text = series_text(system, list(y))
    functions: Any = load_source(text.source, "series")
    vars(functions).update((name, partial(scalars.call, name)) for name in FUNCTIONS)
    rows = np.zeros((ORDER + 1, len(y)), object)
    room = taylor.room_of(text, object)
    expanded(
        Exactly(functions, list(fixed.values())), t, np.array([*y.values()]), ORDER, room, rows
    )
    return rows


def _fixed(program: Program, i: int, values: dict[str, Any]) -> Any:
    one = replace(program, outputs={"it": Output((), (i,))})
    return interpret(one, "it", values, Digits())[0]


def test_the_series_solve_the_equations() -> None:
    """The error of a polynomial of order 12 after 0.001 s is what the next term makes of it."""
    program = everything()
    assert residual(program, recurrences(program, STATES)) < 1e-30


def faults(system: Recurrences) -> list[Recurrences]:
    """The system with one rule changed, each in turn."""
    changed = []
    for i, rule in system.rules.items():
        other: Any = rule
        match rule:
            case Quotient(terms):
                other = Sum(terms)
            case Sum(terms) | Solution(terms=terms):
                last = Term(-terms[-1].sign, *terms[-1].factors)
                other = replace(rule, terms=(*terms[:-1], last))
            case Root() if i < system.one:
                other = Quotient((Term(1, rule.of),), rule.of)
        if other is not rule:
            changed.append(replace(system, rules={**system.rules, i: other}))
    return changed


def test_each_wrong_rule_shows() -> None:
    program = everything()
    system = recurrences(program, STATES)
    kinds = {type(rule) for rule in system.rules.values()}
    assert kinds == {Sum, Quotient, Root, Solution}
    assert min(residual(program, wrong) for wrong in faults(system)) > 1e-20


@pytest.mark.every(2)
@compiler
def test_compiled_coefficients() -> None:
    """They have the bits of those in Python."""
    program = everything()
    states = [SimpleNamespace(name=name) for name in STATES]
    none: Any = {"quaternions": (), "functions": (), "contacts": ()}
    interface: Any = SimpleNamespace(name="everything", states=states, **none)
    texts = taylor.sources(program, interface)
    library = compiled_library(repr(texts), lambda: texts, taylor.MAIN)
    module: Any = SimpleNamespace(
        PARAMETERS={"p": 1.3}, INPUTS={"u": 0.0}, _DEFAULT={"derivative": (1.3,)}
    )
    made = taylor.CompiledTaylor(program, interface, module, library, (None, VALUES))
    plain = taylor.plain_series(program, interface, module, None, VALUES)
    for order in (2, 3, 8, 15, 24):
        for start in np.array(list(START.values())) * np.linspace(0.5, 1.2, 10)[:, None]:
            found, true = (series(0.5, start, order) for series in (made.series, plain))
            assert found.shape == (order + 1, 4)
            assert found.tobytes() == true.tobytes()


@pytest.mark.every(2)
@compiler
def test_the_engine_in_three_languages() -> None:
    """Sums of products, and polynomials."""
    rng = np.random.default_rng(1)
    sizes = {"STATES": 4, "ORDERS": 9, "PRODUCTS": 8}
    given = Given(
        None,
        f"enum {{ {', '.join(f'{n} = {x}' for n, x in sizes.items())} }};\n",
        "".join(f"const {n} = {x};\n" for n, x in sizes.items()) + "const system = {};\n",
    )
    text = Text.of(adaptive, sums, engine)
    factors = [[k, *rng.normal(size=(2, 9, 8)), np.zeros(8)] for k in range(1, 9)]
    changes = [[0.3, order, rng.normal(size=(9, 4)), np.zeros(4)] for order in range(2, 9)]
    for name, cases in (("convolved", factors), ("change_after", changes)):
        python, *others = results(text, name, cases, given=given)
        assert others == [python, python]


def test_functions_with_corners_are_refused() -> None:
    with pytest.raises(RunError, match="'driven' use max; take --integrator DOP853"):
        eomgen.simulate(DRIVEN.replace("3*", "max(x, 0)*"), integrator="taylor", t_end=0.1)
    tape = Tape()
    x = tape.input("x", Stage.POSITIONS)
    nodes = (tape.apply("abs", x).index,)
    with pytest.raises(NoSeriesError, match="abs"):
        recurrences(finish(tape, {"derivative": Output((1,), nodes)}, ()), ["x"])


@pytest.mark.every(2)
@compiler
@pytest.mark.parametrize(("scene", "end"), [("double_pendulum", 1.0), ("tumbling_body", 0.3)])
def test_runs_end_where_they_should(scene: str, end: float) -> None:
    """To within 1e-12, also with quaternions."""
    model = elaborate(read_scene(scene))
    module = load_module(generated_code(model).module, scene)
    true = reference(model, module, t_end=end)
    assert true.error < 1e-13
    run = eomgen.simulate(scene, integrator="taylor", t_end=end, rtol=1e-15, atol=1e-16)
    assert error(run.y[-1], true.y[-1], true.scale) < 1e-12
    loose = eomgen.simulate(scene, integrator="taylor", t_end=end, rtol=1e-7, atol=1e-8)
    assert error(loose.y[-1], true.y[-1], true.scale) < 1e-6
    assert np.abs(loose.y - run.y).max() < 1e-3  # rows within steps


@compiler
@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_series_in_which_most_terms_vanish(rtol: float) -> None:
    """Let go at a right angle a pendulum's angle has every fourth term, so the last two of each
    series vanish for some orders: they do not say how long a step may be.
    """
    found = eomgen.simulate("pendulum", integrator="taylor", rtol=rtol, t_end=5.0)
    true = eomgen.simulate("pendulum", integrator="DOP853", rtol=1e-13, t_end=5.0)
    assert found.y[-1] == pytest.approx(true.y[-1], abs=100 * rtol)


@compiler
@pytest.mark.parametrize("backend", ["auto", "numpy"])
def test_forces_that_depend_on_time(backend: Any) -> None:
    run = eomgen.simulate(
        DRIVEN, integrator="taylor", t_end=4.0, rtol=1e-13, atol=1e-14, backend=backend
    )
    exact = 0.1 + 0.2 * run.t + 1.5 * (1 - np.cos(2 * run.t)) / 4
    assert np.abs(run.y[:, 0] - exact).max() < 1e-12
    assert run.compiled == (backend == "auto")


@compiler
def test_a_run_goes_on_to_the_same_bytes() -> None:
    """Steps in C and single ones, which `follow` asks for, are the same."""
    options: dict[str, Any] = {"integrator": "taylor", "rtol": 1e-9}
    whole = eomgen.simulate("tumbling_body", t_end=4.0, **options)
    begun = eomgen.simulate("tumbling_body", t_end=1.9, **options)
    run = eomgen.simulate("tumbling_body", t_end=4.0, resume=begun, **options)
    assert "as if the run had not ended" in run.begun
    assert run.y[-1].tobytes() == whole.y[-1].tobytes()
    seen = list[float]()
    singly = eomgen.simulate(
        "tumbling_body", t_end=4.0, follow=lambda t, y: bool(seen.append(t)), **options
    )
    assert singly.y.tobytes() == whole.y.tobytes() and len(seen) == whole.trajectory.counts["steps"]
    assert singly.trajectory.counts == whole.trajectory.counts


@compiler
def test_impacts_end_steps() -> None:
    """The events of another method, and while contacts are held its steps."""
    options: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-13, "t_end": 1.2}
    run = eomgen.simulate("bouncing_two_body", integrator="taylor", **options)
    other = eomgen.simulate("bouncing_two_body", integrator="DOP853", **options)
    assert run.finished and len(run.trajectory.events) == len(other.trajectory.events) > 2
    for one, two in zip(run.trajectory.events, other.trajectory.events, strict=True):
        assert (one.contact, one.kind) == (two.contact, two.kind)
        assert math.isclose(one.t, two.t, abs_tol=1e-9)


def test_without_a_compiler_the_run_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    """It goes on in Python."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path))
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    run = eomgen.simulate("pendulum", t_end=0.5, integrator="taylor")
    assert run.finished and not run.compiled
    assert [line for line in run.warnings if "no C compiler was found" in line]


def test_guards_cannot_repair() -> None:
    with pytest.raises(RunError, match="Taylor series cannot be repaired"):
        eomgen.simulate("pendulum", t_end=0.5, integrator="taylor", guard="repair")
