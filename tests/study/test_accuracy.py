"""What accuracy costs in time: ladders against closed forms, orders seen, runs that are wrong."""

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import same_color

from eomgen.commands.main import main
from eomgen.run.integrators import INTEGRATORS, FixedStep
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.trajectory import COUNTS, Trajectory
from eomgen.show.work_precision import COLOURS, TOP, Diagram, draw
from eomgen.study.accuracy import records, work_precision
from eomgen.study.accuracy import reference as truths
from eomgen.study.accuracy.ladder import (
    Ladder,
    Work,
    atol_scale,
    first_steps,
    next_setting,
    order,
)
from eomgen.study.accuracy.measure import scales
from eomgen.study.accuracy.reading import cheapest, observed_order, saved_by_jacobian
from eomgen.study.accuracy.reference import Reference
from eomgen.study.accuracy.trial import Setting
from eomgen.study.accuracy.work_precision import Bench, errors, measure, sweep
from eomgen.tables.integrators import GENERAL as GENERAL_METHODS

FAST = 3.0
APART = 1e-3
SPAN = np.linspace(0.0, 2.0, 201)


def bench(
    rate: float = 0.0, error: float = 1e-16, motion: FloatArray | None = None, t: FloatArray = SPAN
) -> Bench:
    """An oscillator, x = cos 3t, and z' = -rate (z - x) + x' beside it, z = x + w e^(-rate t)."""

    def derivative(t: float, y: FloatArray) -> FloatArray:
        x, v, z = y
        return np.array([v, -(FAST**2) * x, -rate * (z - x) + v])

    def jacobian(t: float, y: FloatArray) -> FloatArray:
        return np.array([[0, 1, 0], [-(FAST**2), 0, 0], [rate, 1, -rate]])

    x, v = np.cos(FAST * t), -FAST * np.sin(FAST * t)
    z = x + APART * np.exp(-rate * t)
    y = np.column_stack([x, v, z]) if motion is None else motion
    states = ("x", "v", "z")
    problem = Problem(
        "oscillator", states, (0,), derivative, jacobian, np.array([1.0, 0.0, 1.0 + APART])
    )
    scale = scales(states, {"x": "m", "v": "m/s", "z": "m"}, y)

    def kinetic(t: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(y[:, 1] ** 2 / 2)

    def energy(t: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(y[:, 1] ** 2 / 2 + (FAST * y[:, 0]) ** 2 / 2)

    truth = Reference(t, y, scale, error, error, "closed form", 0.0)
    return Bench(problem, truth, 1e-3, kinetic, energy, FAST**2 / 2, None, None)


def ladder(found: Bench, quick: bool = False, most_steps: int = 1600) -> Ladder:
    """A ladder that ends for no reason of time."""
    truth = found.reference
    return Ladder(
        t_end=float(truth.t[-1]),
        first=first_steps(found.problem, truth.t, truth.y, truth.scale),
        atol_scale=atol_scale(truth.y, truth.scale),
        quick=quick,
        run_time=60.0,
        most_steps=most_steps,
    )


def climbed(found: Bench, methods: Sequence[str], **options: int) -> dict[str, list[Work]]:
    """All runs of some methods."""
    works: dict[str, list[Work]] = {method: [] for method in methods}
    for work in sweep(found, ladder(found, **options), methods, {}):
        works[work.setting.integrator].append(work)
    return works


@pytest.fixture(autouse=True)
def _no_repeats(monkeypatch: pytest.MonkeyPatch) -> None:
    """Times are not what is tested here."""
    monkeypatch.setattr(work_precision, "ONCE", 0.0)


FIXED = [name for name in GENERAL_METHODS if isinstance(INTEGRATORS[name], FixedStep)]
SERIES = [name for name, method in INTEGRATORS.items() if getattr(method, "series", "")]
ADAPTIVE = [name for name in GENERAL_METHODS if name not in (*FIXED, *SERIES)]


def test_orders_are_those_of_the_methods() -> None:
    """The range is found without knowing them, and the slope there is the order."""
    for method in FIXED:
        nominal = order(method)
        works = climbed(bench(), [method], most_steps=3200 if nominal == 1 else 800)[method]
        if method.startswith("leapfrog"):  # z is pulled by v: it says so, once
            assert [work.status for work in works] == ["refused"] and "depends on" in works[
                0
            ].reason
            continue
        seen = observed_order(works)
        assert seen is not None, method
        assert seen.value == pytest.approx(nominal, rel=0.03), method
        assert seen.coarse >= 3.99 * seen.fine


def test_the_order_is_that_of_the_finest_even_stretch() -> None:
    """Neither of coarse steps, whose slopes may be even too, nor of rounding; or there is none."""

    def works(slopes: Sequence[float]) -> list[Work]:
        sizes = 1e-2 * 2.0 ** -np.cumsum([0.0, *slopes])
        rungs = [Setting("rk4", dt=2.0**-k) for k in range(len(sizes))]
        return [Work(r, "ok", 1.0, 1, error=e) for r, e in zip(rungs, sizes.tolist(), strict=True)]

    seen = observed_order(works([4.8, 4.7, 4.75, 4.4, 4.05, 4.0, 3.95, 1.2, 0.1, 0.1]))
    assert seen is not None and seen.value == pytest.approx(4.0, abs=1e-3)
    assert (seen.coarse, seen.fine) == pytest.approx((2.0**-4, 2.0**-7))
    assert observed_order(works([4.8, 4.3, 3.6, 2.9])) is None
    assert observed_order(works([4.0])) is None


def test_errors_are_those_of_the_closed_form() -> None:
    """Of explicit Euler: |1 + 3ih|^n instead of 1."""
    found = bench()
    x, v, _ = found.reference.scale
    for steps in (50, 400, 3200):
        work = measure(found, Setting("euler", dt=2.0 / steps), 60.0)
        z = (1 + 3j * 2.0 / steps) ** steps
        end = max(abs(z.real - math.cos(6)) / x, 3 * abs(z.imag - math.sin(6)) / v)
        assert work.final_error == pytest.approx(end, rel=1e-9)
        assert work.energy_drift == pytest.approx(abs(z) ** 2 - 1, rel=1e-9)
        assert (work.steps, work.derivatives) == (steps, steps)
        assert work.error >= work.final_error and work.status == ("ok" if steps > 50 else "wrong")


def test_tighter_tolerances_give_smaller_errors() -> None:
    """By every adaptive method; only those that use the Jacobian ask for it."""
    found = bench()
    climb = ladder(found)
    for method in ADAPTIVE:
        done: dict[Setting, Work] = {}
        while (setting := next_setting(climb, method, done)) and (setting.rtol or 0) > 1e-7:
            done[setting] = measure(found, setting, 60.0)
        loosest, *_, tightest = done.values()
        assert [r.rtol for r in done] == [1e-2, 1e-3, 1e-4, 1e-5, 1e-6]
        assert all(r.atol == pytest.approx(2e-3 * (r.rtol or 0), rel=2e-3) for r in done)
        assert tightest.error < 1e-4 and tightest.error < loosest.error / 100, method
        assert tightest.derivatives > loosest.derivatives
        assert (tightest.jacobians > 0) == (
            method in ("Rodas5P", "Radau", "BDF")
        ) or method == "LSODA"


def test_runs_that_are_wrong_or_fail_are_reported_and_stay() -> None:
    """A stiff state that explicit steps cannot take; implicit ones do."""
    stiff = bench(rate=4e4)
    works = climbed(stiff, ["rk4", "implicit_midpoint"], most_steps=400)
    assert {work.status for work in works["rk4"]} <= {"failed", "wrong"}
    failed = [work for work in works["rk4"] if work.status == "failed"]
    assert failed and all(work.reason and math.isnan(work.error) for work in failed)
    assert all(0 <= work.stopped_at < 2 and "t = " not in work.reason for work in failed)
    assert works["implicit_midpoint"][-1].status == "ok"
    coarse = climbed(bench(), ["euler"], most_steps=50)["euler"]
    assert [work.status for work in coarse] == ["wrong"] * len(coarse)
    assert all("reported success" in work.reason and work.error >= 0.1 for work in coarse)


def test_errors_below_the_reference_are_bounds() -> None:
    """What lies within 100 times its error is "at most" that, and ends the ladder."""
    works = climbed(bench(error=1e-10), ["rk4", "DOP853"])
    for own in works.values():
        bounds = [work for work in own if work.at_most[0]]
        assert len(bounds) >= 2 and all(work.error == 1e-8 for work in bounds)
        assert own[-2:] == bounds[-2:]
        assert all(work.error > 1e-8 for work in own if not work.at_most[0])
    seen = observed_order(works["rk4"])
    assert seen is not None and seen.value == pytest.approx(4, rel=0.04)
    assert min(work.error for work in cheapest(works["DOP853"], 1e-8)) <= 1e-8
    assert cheapest(works["DOP853"], 1e-9) == []


def test_a_run_over_its_time_ends_its_ladder() -> None:
    """It is kept as such, and made again only if it may now take longer."""
    found = bench()
    slow = replace(ladder(found, most_steps=25 * 2**14), run_time=0.3)
    work = measure(found, Setting("implicit_midpoint", dt=1e-5), 0.3)
    assert work.status == "over" and 0.3 <= work.seconds < 3 and math.isnan(work.error)
    first = Setting("Radau", rtol=1e-2, atol=2e-5)
    over = replace(work, setting=first, seconds=0.31)
    assert next_setting(slow, "Radau", {first: over}) is None
    assert next_setting(replace(slow, run_time=1.0), "Radau", {first: over}) == first


def test_rounding_ends_a_ladder() -> None:
    """Two finer runs that gain nothing are enough; far from rounding they are not."""
    whole = replace(ladder(bench()), most_steps=25 * 2**12)
    for smallest, expected in ((1e-12, 10), (1e-5, 13)):
        done: dict[Setting, Work] = {}
        while setting := next_setting(whole, "rk4", done):
            assert setting.dt is not None
            done[setting] = Work(setting, "ok", 0.0, 1, error=max(setting.dt**4, smallest))
        assert len(done) == expected


def test_rows_are_compared_at_their_own_times() -> None:
    """Coarser steps than rows have fewer of them; of two rows at an impact the later counts."""
    found = bench()
    truth = found.reference
    works = [measure(found, Setting("rk4", dt=2.0 / n), 60.0) for n in (25, 50, 100, 200, 400)]
    ratios = [a.error / b.error for a, b in pairwise(works)]
    assert min(ratios) > 12

    t = np.insert(truth.t, 101, truth.t[100])
    y = np.insert(truth.y, 100, truth.y[100] + 5, axis=0)
    counts = dict.fromkeys(COUNTS, 0)
    run = Trajectory("x", found.problem.states, t, y, "rk4", True, "", counts)
    assert errors(run, truth) == (0.0, 0.0)


def test_quaternions_are_measured_before_they_are_scaled() -> None:
    """Euler's step leaves the sphere by (h w / 2)² / 2, every time."""

    def derivative(t: float, y: FloatArray) -> FloatArray:
        return np.array([-y[1], y[0], 0.0, 0.0]) * 3.0

    def jacobian(t: float, y: FloatArray) -> FloatArray:
        found = np.zeros((4, 4))
        found[0, 1], found[1, 0] = -3.0, 3.0
        return found

    y = np.column_stack([np.cos(3 * SPAN), np.sin(3 * SPAN), 0 * SPAN, 0 * SPAN])
    plain = bench(motion=y)
    problem = Problem(
        "turn",
        tuple("abcd"),
        (0, 1, 2, 3),
        derivative,
        jacobian,
        np.array([1.0, 0, 0, 0]),
        ((0, 1, 2, 3),),
    )
    truth = replace(plain.reference, scale=np.ones(4))
    found = replace(plain, problem=problem, reference=truth, energy=None)
    for h in (0.02, 0.005):
        work = measure(found, Setting("euler", dt=h), 60.0)
        assert work.quaternion_defect == pytest.approx(math.hypot(1, 3 * h) - 1, rel=1e-9)
    adaptive = measure(found, Setting("RK45", rtol=1e-6, atol=1e-9), 60.0)
    assert 0 < adaptive.quaternion_defect < 1e-5
    assert math.isnan(measure(bench(), Setting("euler", dt=0.02), 60.0).quaternion_defect)


def test_what_the_jacobian_saves() -> None:
    """The median over runs of the same tolerances that were both right."""
    times = {"Radau": (1.0, 2.0, 4.0), "Radau_differences": (3.0, 4.0, 20.0)}
    works = [
        Work(Setting(method, rtol=10.0**-k, atol=1e-9), "ok", seconds, 3)
        for method, own in times.items()
        for k, seconds in enumerate(own)
    ]
    assert saved_by_jacobian(works) == {"Radau": 3.0}
    works[0] = replace(works[0], status="wrong")
    assert saved_by_jacobian(works) == {"Radau": 3.5}


def test_methods_are_ranked_by_counted_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """However long each took on a busy machine; that spreads from the least to the median."""
    monkeypatch.setattr(work_precision, "ONCE", 1.0)
    found = bench(error=1e-9)
    slow = measure(found, Setting("euler", dt=0.001), 60.0)
    works = [measure(found, Setting("DOP853", rtol=1e-9, atol=1e-12), 60.0), slow]
    assert works[0].units < works[1].units and works[0].spread >= 0
    busy = [replace(works[0], seconds=1e3), works[1]]
    assert [w.setting.integrator for w in cheapest(busy, 0.1)] == ["DOP853", "euler"]
    again = measure(found, slow.setting, 60.0)
    assert again.units == slow.units


def cells(path: Path, *, times: bool = False) -> list[dict[str, str]]:
    """What a table holds of each run, without what depends on the machine."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    same = ["t_end_s", "given", "reference_error", "derivative_s", "jacobian_s"]
    assert [*rows[0]] == [*records.COLUMNS, *same, records.GENERATION, records.KEY]
    assert {row["t_end_s"] for row in rows} == {rows[0]["t_end_s"]}
    kept = [k for k in records.COLUMNS if times or k not in records.TIMES]
    return [{k: row[k] for k in kept} for row in rows]


def test_records_come_back_as_they_were(tmp_path: Path) -> None:
    """Of all methods, bounds and failures among them; under another key, or damaged, none do."""
    found = bench(error=1e-9)
    stiff = climbed(bench(rate=4e4), ["rk4"], most_steps=200)["rk4"]
    works = [w for own in climbed(found, ["DOP853", "Radau"]).values() for w in own] + stiff
    path = tmp_path / "x_accuracy.csv"
    records.save(path, "ab12", works, generation=1.25, same={"given": 'of an\n"oscillator"'})
    back, generation = records.load(path, "ab12")
    assert generation == 1.25
    assert repr([back[work.setting] for work in works]) == repr(works)  # nan is not nan
    assert list(back) == [work.setting for work in records.ordered(works)]
    whole = path.read_text()
    path.write_text(whole.rstrip().rpartition(",")[0])  # the last row breaks off
    assert records.load(path, "ab12") == ({}, None)
    path.write_text(whole)
    assert records.load(path, "ab13") == ({}, None)
    path.write_text(path.read_text("utf-8").replace(",ok,", ",fine,", 1), "utf-8")
    assert records.load(path, "ab12") == ({}, None)
    assert records.load(tmp_path / "none.csv", "ab12") == ({}, None)
    assert len({records.key("m", {"a": x}) for x in (1.0, 2.0, 1.0)}) == 2


QUICK = "--quick --no-arithmetic --t-end 0.2 --methods rk4,DOP853 --run-time 1000".split()
"""No run is over its time, however slow the machine: what is run is the same each time."""


@pytest.mark.usefixtures("blank_figures")
def test_what_was_interrupted_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """After an interrupt only what is missing is run, and the table is the same but for times."""
    whole, parted = tmp_path / "whole", tmp_path / "parted"
    assert main(["accuracy", "pendulum", *QUICK, "-o", str(whole)]) == 0
    assert "taken from the table" not in capsys.readouterr().out
    made = []

    def interrupted(found: Bench, setting: Setting, run_time: float) -> Work:
        if len(made) == 5:
            raise KeyboardInterrupt
        made.append(setting)
        return measure(found, setting, run_time)

    monkeypatch.setattr(work_precision, "measure", interrupted)
    assert main(["accuracy", "pendulum", *QUICK, "-o", str(parted)]) == 130
    table = parted / "pendulum_accuracy.csv"
    assert len(cells(table)) == 5
    kept = {row["method"] + row["dt_s"] + row["rtol"]: row for row in cells(table, times=True)}
    again = []

    def counted(found: Bench, setting: Setting, run_time: float) -> Work:
        again.append(setting)
        return measure(found, setting, run_time)

    monkeypatch.setattr(work_precision, "measure", counted)
    assert main(["accuracy", "pendulum", *QUICK, "-o", str(parted)]) == 0
    text = capsys.readouterr().out
    assert not set(again) & set(made)
    assert f"{len(again)} runs made now, 5 taken from the table" in text
    assert cells(table) == cells(whole / "pendulum_accuracy.csv")
    for row in cells(table, times=True):
        assert row == kept.get(row["method"] + row["dt_s"] + row["rtol"], row)
    names = ["pendulum_accuracy.csv", "pendulum_accuracy.png", "pendulum_reference.npz"]
    assert sorted(path.name for path in parted.iterdir()) == names
    again.clear()
    assert main(["accuracy", "pendulum", *QUICK, "-o", str(parted)]) == 0 and not again
    capsys.readouterr()
    assert main(["accuracy", "pendulum", *QUICK, "--set", "gravity_g=5", "-o", str(parted)]) == 0
    assert len(again) == len(cells(table)) and "taken from" not in capsys.readouterr().out
    again.clear()
    assert main(["accuracy", "pendulum", *QUICK, "--fresh", "-o", str(parted)]) == 0
    assert len(again) == len(cells(table))


@pytest.mark.usefixtures("blank_figures")
def test_the_table_says_what_it_must(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Cost of a call, generation, reference, orders, cheapest runs; a wrong run as such."""
    arguments = "--no-arithmetic --t-end 2 --run-time 0.2 --methods euler,rk4,DOP853".split()
    assert main(["accuracy", "pendulum", *arguments, "-o", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert re.search(r"one derivative takes [\d.]+ µs, one Jacobian [\d.]+ µs; generated in", text)
    assert re.search(r"its own relative error \de-1\d", " ".join(text.split()))
    assert re.search(r"euler +dt 0.08 +wrong", text)
    assert re.search(r"rk4 +4   (3\.[89]|4\.[01])\d over dt", text)
    assert re.search(r"1e-06  (rk4 at dt|DOP853 at rtol)", text)
    assert max(map(len, text.splitlines())) <= 130


@pytest.mark.usefixtures("blank_figures")
def test_scenes_by_form(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Redundant forms have gaps in their joints; driven scenes account for works."""
    monkeypatch.setattr(truths, "reference", partial(truths.reference, seconds=0.0))
    quick = "--quick --no-arithmetic --t-end 0.3 --methods rk4 --run-time 1000".split()
    assert main(["accuracy", "two_body", "--form", "redundant", *quick, "-o", str(tmp_path)]) == 0
    rows = cells(tmp_path / "two_body_redundant_accuracy.csv")
    gaps = [float(row["joint_gap_m"]) for row in rows]
    assert gaps[0] > 1e3 * gaps[-1] > 0
    assert main(["accuracy", "cart_pole", "--input", "push=2", *quick, "-o", str(tmp_path)]) == 0
    rows = cells(tmp_path / "cart_pole_accuracy.csv")
    drifts = [float(row["energy_drift"]) for row in rows if row["energy_drift"]]
    assert min(drifts) < 1e-8 and {row["joint_gap_m"] for row in rows} == {""}
    assert "do not explain" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("--methods rk5", "unknown name 'rk5' (did you mean 'rk4'?)"),
        ("--methods ,", "--methods: names no integrator"),
        ("--run-time 0", "--run-time: 0 is not a positive time"),
        ("--time nan", "--time: nan is not a positive time"),
        ("--t-end -1", "--t-end: -1 is not a positive time"),
        ("--set nothing=1", "--set: no parameter 'nothing'"),
        ("--input tau=1", "--input: no input 'tau'"),
    ],
)
def test_bad_input(
    arguments: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One clear line, exit code 1, and nothing written."""
    given = [
        "accuracy",
        "pendulum",
        "--no-arithmetic",
        *arguments.split(),
        "-o",
        str(tmp_path / "out"),
    ]
    assert main(given) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and words in lines[0]


def test_files_of_others_are_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Before anything is run."""
    theirs = tmp_path / "pendulum_accuracy.csv"
    theirs.write_text("mine\n")
    assert main(["accuracy", "pendulum", *QUICK, "-o", str(tmp_path)]) == 1
    assert "was not written by eomgen" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == [theirs.name]


def test_the_figure_has_a_line_a_method_and_every_run(tmp_path: Path) -> None:
    """Right runs on lines, the others as marks, none higher than the top."""
    found = bench(error=1e-10)
    methods = ["euler", "rk4", "DOP853", "Radau"]
    works = [w for own in climbed(found, methods, most_steps=800).values() for w in own]
    failed = Work(Setting("Radau", rtol=1e-13, atol=1e-16), "failed", 0.7, 1, derivatives=9)
    over = Work(Setting("BDF", rtol=1e-2, atol=1e-5), "over", 3.0, 1, derivatives=99)
    works += [failed, over]
    figure = draw(Diagram("x", "about\nit", found.floors[0], "Energy", False), works)
    main_axes, evaluations, energy = figure.axes
    lines = {line.get_label(): line for line in main_axes.get_lines()}
    for method in methods:
        line = lines[method]
        right = [w for w in works if w.setting.integrator == method and w.status == "ok"]
        assert np.allclose(line.get_ydata(), [w.error for w in right], rtol=0, atol=0)
        assert np.allclose(line.get_xdata(), [w.seconds for w in right], rtol=0, atol=0)
        assert same_color(line.get_color(), COLOURS[method])
    drawn = [
        (x, y) for line in main_axes.get_lines() for x, y in zip(*line.get_data(), strict=True)
    ]
    for work in works:
        error = TOP if math.isnan(work.error) else min(work.error, TOP)
        assert (work.seconds, error) in drawn
    assert main_axes.get_xscale() == main_axes.get_yscale() == "log"
    assert main_axes.get_ylim()[1] == TOP and main_axes.get_ylim()[0] < found.floors[0]
    assert any("not resolved" in text.get_text() for text in main_axes.texts)
    assert {line.get_label() for line in energy.get_lines()} >= set(methods)
    assert evaluations.get_xlabel() == "derivatives evaluated"
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert {*methods, "Explicit", "Implicit", "failed", "at most"} <= set(texts)
    redundant = draw(Diagram("x", "about", 1e-20, "", True), works)
    titles = [axes.get_title(loc="left") for axes in redundant.axes]
    assert titles[-1] == "Gap in the joints, m" and len(titles) == 3
    assert not any("not resolved" in text.get_text() for text in redundant.axes[0].texts)
