"""Runs with a proof: each part against numbers with more digits, and what a user gets.

A box is usually much wider than need be, so that motions inside it show few faults: remainder,
derivatives, turned sets and rounding have a test each.
"""

import json
import math
import os
import random
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from extrapolated import Rate, moved, rate_of
from mpmath import mp
from smooth_program import START, STATES, VALUES, everything

import eomgen
from eomgen.base.errors import RunError
from eomgen.certified import steps
from eomgen.certified.balls import SHORT, Ball, ball, column, matrix, precision, size
from eomgen.certified.recursion import Motion
from eomgen.certified.steps import Pace, Plan, Spread, Step, step_from
from eomgen.commands.main import main
from eomgen.program.program import Output, finish
from eomgen.program.tape import Stage, Tape
from eomgen.store import program_of

flint = pytest.importorskip("flint")

ROOT = Path(__file__).parents[2]


def exactly(x: Any) -> Ball:
    """A number with 60 digits as a ball, exact."""
    sign, significand, exponent, _ = mp.mpf(x)._mpf_
    with precision(4096):
        return flint.arb(int(-significand if sign else significand)) * flint.arb(2) ** int(exponent)


@pytest.fixture(autouse=True)
def _sixty_digits() -> Any:
    with mp.workdps(60):
        yield


def smooth() -> tuple[Motion, list[Ball], Rate]:
    """The motion of all functions, its fixed values and its derivative."""
    program = everything()
    motion = Motion.of(program, STATES)
    with precision(400):
        fixed = motion.fixed({name: ball(x) for name, x in VALUES.items()})
    return motion, list(fixed), rate_of(program, STATES, VALUES)


def stepped(motion: Motion, fixed: list[Ball], spread: float, h: float = 0.02) -> Step:
    """A step of all functions from a set that is turned against the axes."""
    axes = [[math.cos(i * j + 1.0) + 2 * (i == j) for j in range(4)] for i in range(4)]
    place = (
        ball(0.5),
        [ball(x) for x in START.values()],
        Spread(matrix([[ball(x) for x in row] for row in axes]), [ball(0.0, spread)] * 4),
    )
    step, _ = step_from(motion, fixed, place, Pace(h), Plan(1e-14, 200, 16))
    assert step is not None
    return step


def test_coefficients_solve_the_equations() -> None:
    """The polynomial of order 12 misses the motion by what its next term makes of it."""
    motion, fixed, rate = smooth()
    with precision(200):
        rows, _ = motion.series(fixed, ball(0.5), [ball(x) for x in START.values()], 12)
    h = mp.mpf(1) / 1024
    there = moved(rate, mp.mpf("0.5"), [mp.mpf(x) for x in START.values()], h)
    for row, value in zip(rows, there, strict=True):
        with precision(200):
            total = sum((c * exactly(h) ** k for k, c in enumerate(row)), ball(0.0))
            assert size(total - exactly(value)) < 1e-27


def test_derivatives_are_those_of_the_coefficients() -> None:
    """Along a direction, by a difference quotient of coefficients."""
    motion, fixed, _ = smooth()
    along = [0.3, -1.0, 0.5, 0.7]
    with precision(400):
        y = [ball(x) for x in START.values()]
        tiny = ball(2.0**-200)
        rows, series = motion.series(fixed, ball(0.5), y, 9)
        there, _ = motion.series(
            fixed, ball(0.5), [a + tiny * b for a, b in zip(y, along, strict=True)], 9
        )
        found = motion.change(fixed, series, [ball(x) for x in along], 9)
        for a, b, c in zip(rows, there, found, strict=True):
            for k in range(10):
                assert size((b[k] - a[k]) / tiny - c[k]) < 1e-50


def test_the_remainder_holds_the_next_term() -> None:
    """Its coefficient is that of any state of the step, and it is added in full."""
    motion, fixed, rate = smooth()
    step = stepped(motion, fixed, 0.0)
    order = len(step.centre[0])
    for part in (0.0, 0.3, 0.7, 0.999):
        time = 0.5 + part * float(step.h)
        with precision(200):
            state = [exactly(x) for x in moved_from(rate, step, time, [0.0] * 4)]
            rows, _ = motion.series(fixed, ball(time), state, order)
        assert all(r.contains(row[order]) for r, row in zip(step.rest, rows, strict=True))
    short = replace(step, rest=[ball(0.0)] * 4)
    for whole, without, rest in zip(step.box(time), short.box(time), step.rest, strict=True):
        with precision(200):
            term = rest * (ball(time) - 0.5) ** order
            assert whole.contains(without + term)
            assert size(whole - without) < 1.01 * size(term) + 1e-50


@pytest.mark.parametrize("spread", [1e-20, 1e-4])
def test_every_state_of_the_set_goes_into_the_box(spread: float) -> None:
    """Corners of the set, which are where a derivative that is too small shows at once: of a narrow
    set, whose box the derivative fills, and of a wide one. Later and in between.
    """
    motion, fixed, rate = smooth()
    step = stepped(motion, fixed, spread)
    corners = [[sign * spread * 0.999 for sign in signs] for signs in _signs(4)]
    least = [1.0] * 4
    for part in (0.4, 0.999):
        time = 0.5 + part * float(step.h)
        boxes, centre = step.box(time), moved_from(rate, step, time, [0.0] * 4)
        for corner in corners:
            there = moved_from(rate, step, time, corner)
            for j, (box, x, c) in enumerate(zip(boxes, there, centre, strict=True)):
                with precision(200):
                    assert box.contains(exactly(x))
                    wide = max(size(box - exactly(c)), 1e-300)
                    least[j] = min(least[j], 1 - size(exactly(x - c)) / wide)
    if spread < 1e-10:
        assert max(least) < 0.05  # the box is filled


def _signs(n: int) -> list[tuple[int, ...]]:
    return [tuple(1 - 2 * (i >> j & 1) for j in range(n)) for i in range(2**n)]


def moved_from(rate: Rate, step: Step, time: float, corner: Sequence[float]) -> list[Any]:
    """Where a state of a step's set is at a time."""
    axes = step.spread.axes
    start = [
        mp.mpf(x) + sum(mp.mpf(float(axes[i, j])) * mp.mpf(e) for j, e in enumerate(corner))
        for i, x in enumerate(START.values())
    ]
    return moved(rate, mp.mpf("0.5"), start, mp.mpf(time) - mp.mpf("0.5"))


def test_the_enclosure_holds_the_whole_step() -> None:
    """All states in between lie in the box over which the remainder is taken."""
    motion, fixed, rate = smooth()
    h = 0.02
    with precision(SHORT):
        low, _ = motion.series(fixed, ball(0.5), [ball(x, 1e-3) for x in START.values()], 8)
        times = ball(0.5 + h / 2, h / 2)
        held = steps._enclosure(motion, fixed, times, low, ball(h))
    assert held is not None
    for part in range(5):
        for sign in (-1, 1):
            start = [mp.mpf(x) + sign * mp.mpf("0.000999") for x in START.values()]
            there = moved(rate, mp.mpf("0.5"), start, mp.mpf(h) * part / 4)
            with precision(200):
                assert all(b.contains(exactly(x)) for b, x in zip(held, there, strict=True))


def oscillator() -> tuple[Motion, list[Ball]]:
    """The motion of a' = b, b' = -p a, whose derivative by the start is that of all states."""
    tape = Tape()
    p = tape.input("p", Stage.PARAMETERS)
    a, b = (tape.input(name, Stage.POSITIONS) for name in "ab")
    program = finish(tape, {"derivative": Output((2,), (b.index, (-(p * a)).index))}, ())
    motion = Motion.of(program, ("a", "b"))
    return motion, list(motion.fixed({"p": ball(9.0)}))


def test_the_last_term_of_the_derivative_is_that_of_all_of_the_step() -> None:
    """Of an oscillator, whose derivative by the start is that of all states: the coefficient holds
    J^k/k! exp(J τ) for all τ, and it is added in full.
    """
    motion, fixed = oscillator()
    place = (
        ball(0.0),
        [ball(1.0), ball(0.5)],
        Spread(matrix([[ball(1.0), ball(0.0)], [ball(0.0), ball(1.0)]]), [ball(0.0)] * 2),
    )
    step, _ = step_from(motion, fixed, place, Pace(0.25), Plan(1e-8, 100, 12))
    assert step is not None
    k = len(step.slopes)
    for part in (0.0, 0.5, 1.0):
        with precision(200):
            jacobian = matrix([[ball(0.0), ball(1.0)], [ball(-9.0), ball(0.0)]])
            flow = (jacobian * (step.h * part)).exp()
            term = jacobian**k * flow / flint.arb.fac_ui(k)
            assert step.last.contains(term)
            if part == 1.0:
                assert step._at(step.h)[1].contains(flow)
    without = replace(step, last=step.last * 0)
    with precision(200):
        added = step._at(step.h)[1] - without._at(step.h)[1]
        assert added.contains((step.last * step.h**k).mid())
        assert all(
            size(x) >= 0.99 * size(y)
            for x, y in zip(added.entries(), (step.last * step.h**k).entries(), strict=True)
        )


def test_the_enclosure_has_all_of_its_last_term_and_a_solution_in_it() -> None:
    """Of an oscillator with a term of order 2, which is most of it; and of a' = a², which is
    infinite at t = 1: beyond that nothing is found.
    """
    motion, fixed = oscillator()
    h = 0.1
    with precision(SHORT):
        low, _ = motion.series(fixed, ball(0.0), [ball(1.0), ball(0.0)], 2)
        held = steps._enclosure(motion, fixed, ball(h / 2, h / 2), low, ball(h))
    assert held is not None
    assert held[0].contains(exactly(mp.cos(3 * mp.mpf(h))))
    tape = Tape()
    a = tape.input("a", Stage.POSITIONS)
    square = Motion.of(finish(tape, {"derivative": Output((1,), ((a * a).index,))}, ()), ("a",))
    for length, found in ((0.3, True), (1.1, False)):
        with precision(SHORT):
            low, _ = square.series([], ball(0.0), [ball(1.0)], 8)
            box = steps._enclosure(square, [], ball(length / 2, length / 2), low, ball(length))
        assert (box is not None) == found


def test_a_set_is_held_with_any_axes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing depends on how well axes are made orthogonal."""
    rows = [[1.0, 0.3], [-0.2, 0.5]]
    monkeypatch.setattr(steps, "_orthogonal", lambda columns, order: rows)
    with precision(SHORT):
        product = matrix([[ball(1.0), ball(2.0)], [ball(0.5), ball(-1.0)]])
        box, rest = [ball(0.0, 1e-3)] * 2, [ball(0.0, 1e-6)] * 2
        turned = steps._turned(product, box, rest)
    for signs in _signs(2):
        with precision(200):
            point = product * column([ball(s * 0.99e-3) for s in signs])
            inside = turned.axes.inv() * point
            assert all(b.contains(x) for b, x in zip(turned.box, inside.entries(), strict=True))


def test_a_turned_set_holds_the_first() -> None:
    """Corners of a product and of a rest, for products from far from to near to singular."""
    draw = random.Random(5)
    for n in (1, 2, 5):
        for near in (1.0, 1e-6, 1e-13):
            rows = [[draw.uniform(-1, 1) for _ in range(n)] for _ in range(n)]
            rows[-1] = [near * x + 0.5 * y for x, y in zip(rows[-1], rows[0], strict=True)]
            box = [ball(0.0, 10.0 ** draw.randint(-8, 0)) for _ in range(n)]
            rest = [ball(0.0, 1e-9) for _ in range(n)]
            with precision(SHORT):
                product = matrix([[ball(x) for x in row] for row in rows])
                turned = steps._turned(product, box, rest)
            for signs in _signs(n):
                with precision(400):
                    corner = column([s * x.rad() for s, x in zip(signs, box, strict=True)])
                    point = product * corner + column(
                        [s * x.rad() for s, x in zip(signs, rest, strict=True)]
                    )
                    inside = turned.axes.inv() * point
                    held = zip(turned.box, inside.entries(), strict=True)
                    assert all(b.overlaps(x) for b, x in held)


def test_the_pendulum_is_that_of_elliptic_functions() -> None:
    """φ = 2 asin(k sn(K - ω t)) from rest, with φ = θ + π/2: 25 digits and more."""
    theta = 0.25
    found = eomgen.certify(
        "pendulum", t_end=3.0, tolerance=1e-27, samples=5, state={"theta": theta, "theta_dot": 0.0}
    )
    assert found.finished
    assert found.largest <= 1e-27
    values = eomgen.load(eomgen.generate("pendulum")).PARAMETERS
    k = mp.sin((theta + mp.pi / 2) / 2)
    omega = mp.sqrt(mp.mpf(values["gravity_g"]) / abs(mp.mpf(values["pivot_r_child_x"])))
    for t, y, low, radius in zip(found.t, found.y, found.low, found.radius, strict=True):
        u = mp.ellipk(k**2) - omega * mp.mpf(float(t))
        angle = 2 * mp.asin(k * mp.ellipfun("sn", u, m=k**2)) - mp.pi / 2
        assert abs(mp.mpf(float(y[0])) + mp.mpf(float(low[0])) - angle) <= radius[0] + 1e-50


@pytest.mark.parametrize("name", ["double_pendulum", "spinning_top", "four_bar"])
@pytest.mark.every(3)
def test_motions_are_held(name: str) -> None:
    """Against 40 digits, by another method."""
    model = eomgen.check(name)
    module = eomgen.load(eomgen.generate(name))
    rate = rate_of(program_of(model), module.STATES, dict(module.PARAMETERS))
    found = eomgen.certify(name, t_end=0.3, tolerance=1e-24, samples=4)
    y, t = [mp.mpf(float(x)) for x in found.y[0]], mp.mpf(0)
    for i in range(1, 4):
        h = mp.mpf(float(found.t[i])) - t
        for _ in range(8):
            y, t = moved(rate, t, y, h / 8), t + h / 8
        for x, a, b, radius in zip(y, found.y[i], found.low[i], found.radius[i], strict=True):
            assert abs(mp.mpf(float(a)) + mp.mpf(float(b)) - x) <= radius <= 1e-24


def test_all_motions_of_uncertain_values_are_held() -> None:
    """Of parameters and of the start; the corners are run with small errors."""
    widths = {"bob_mass": 0.005, "pivot_r_child_x": 0.002, "theta": 0.01}
    found = eomgen.certify("pendulum", t_end=1.0, samples=11, uncertain=widths)
    values = eomgen.load(eomgen.generate("pendulum"))
    for signs in _signs(3):
        off = {name: s * x for s, (name, x) in zip(signs, widths.items(), strict=True)}
        own = {n: values.PARAMETERS[n] + off[n] for n in ("bob_mass", "pivot_r_child_x")}
        theta = float(values.initial_state()[0]) + off["theta"]
        run = eomgen.simulate(
            "pendulum", t_end=1.0, samples=11, rtol=1e-12, parameters=own, state={"theta": theta}
        )
        rows = np.searchsorted(run.t, found.t)
        np.testing.assert_array_equal(run.t[rows], found.t)
        assert np.all(np.abs(run.y[rows] - found.y[:, :2]) <= found.radius[:, :2] + 1e-9)
    assert found.states == (*values.STATES, "bob_mass", "pivot_r_child_x")
    assert found.largest < 0.1


def test_errors_of_a_run_are_proven(tmp_path: Path) -> None:
    """Of a run in a file: what is added to a row is found to the last digit."""
    run = eomgen.simulate("double_pendulum", t_end=1.0, samples=21, rtol=1e-6)
    found = eomgen.certify(run, tolerance=1e-13)
    assert found.finished
    assert found.error is not None
    assert found.least is not None
    fine = eomgen.simulate("double_pendulum", t_end=1.0, samples=21, rtol=1e-13)
    true = np.abs(run.y - fine.y)
    assert np.all(found.least <= true + 1e-11)
    assert np.all(true <= found.error + 1e-11)
    assert 1e-8 < true.max() < 1e-4
    np.testing.assert_allclose(found.error, found.least, atol=1e-12)


def test_what_a_user_reads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The command: a scene, its table, the errors of a saved run."""
    target = tmp_path / "p.json"
    assert main(["certify", "pendulum", "--t-end", "1", "-o", str(target)]) == 0
    out = capsys.readouterr().out
    assert "proven to t = 1 s" in out
    assert "radius      at most" in out
    content = json.loads(target.read_text())
    assert content["states"] == ["theta", "theta_dot"]
    assert max(map(max, content["radius"])) <= 1e-9
    assert main(["simulate", "pendulum", "--t-end", "1", "-o", str(tmp_path)]) == 0
    capsys.readouterr()
    table = str(tmp_path / "e.csv")
    assert main(["certify", str(tmp_path / "pendulum.npz"), "-o", table]) == 0
    assert "error       between" in capsys.readouterr().out
    assert Path(table).read_text().startswith("t,theta,theta.low,theta.radius,theta.error,")


@pytest.mark.parametrize(
    ("source", "options", "line"),
    [
        ("bouncing_two_body", {}, "certify: rigid contacts strike"),
        ("pendulum", {"tolerance": -1.0}, "tolerance: -1 is not a positive radius"),
        ("pendulum", {"samples": 1}, "samples: 1 is not a number of rows"),
        ("pendulum", {"uncertain": {"theta": -0.1}}, "uncertain: theta has a negative width"),
        ("pendulum", {"uncertain": {"thet": 0.1}}, "uncertain: no state or parameter 'thet'"),
        ("pendulum", {"t_end": 0.0}, "t_end: 0 is not a positive time"),
    ],
)
def test_each_mistake_has_one_clear_line(source: str, options: dict[str, Any], line: str) -> None:
    """What cannot be proven, and what is no number."""
    with pytest.raises(RunError, match=line):
        eomgen.certify(source, **options)


def test_what_is_not_proven_is_said() -> None:
    """A set that grows too wide: the rows up to there, and up to when."""
    found = eomgen.certify("double_pendulum", t_end=10.0, samples=11, uncertain={"theta_1": 0.02})
    assert not found.finished
    assert found.message.startswith("proven up to t = ")
    assert 1 <= len(found.t) < 11


@pytest.mark.full
def test_modules_are_the_same_with_python_flint() -> None:
    """SymPy computes with it where it is installed."""
    environment = {**os.environ, "SYMPY_GROUND_TYPES": "flint"}
    code = (
        "import sympy.external.gmpy as g; assert g.GROUND_TYPES == 'flint'; import sys;"
        "from eomgen.commands.main import main;"
        "sys.exit(main(['generate', '--all', '--check', '-o', 'generated']))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=environment)
    assert done.returncode == 0
