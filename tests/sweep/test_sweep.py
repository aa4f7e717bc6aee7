"""Sweeps: members are single runs, whatever runs them, and what was stopped goes on."""

import csv
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from falling_block import BLOCK
from matplotlib.figure import Figure

import eomgen
from eomgen.api import saving
from eomgen.api.saving import save_statistics, save_sweep
from eomgen.base.errors import RunError
from eomgen.commands.main import main
from eomgen.native import accelerator
from eomgen.results import ensemble
from eomgen.results.design import Law
from eomgen.results.ensemble import Ensemble
from eomgen.run.through_events import THROUGH_EVENTS
from eomgen.show.sweep import draw_sweep
from eomgen.sweep import execute, members, storage, together

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
MASSES = (0.5, 1.0, 1.7)
QUICK: dict[str, Any] = {"t_end": 1.0, "integrator": "DOP853", "rtol": 1e-8}


def same(one: Ensemble, other: Ensemble) -> bool:
    """Whether two sweeps have the same bytes."""
    names = ("final", "t", "codes", "times")
    alike = all(getattr(one, n).tobytes() == getattr(other, n).tobytes() for n in names)
    alike = alike and one.messages.tolist() == other.messages.tolist()
    rows = [b"" if e.rows is None else e.rows.tobytes() for e in (one, other)]
    outputs = [{n: v.tobytes() for n, v in e.outputs.items()} for e in (one, other)]
    return alike and rows[0] == rows[1] and outputs[0] == outputs[1]


@pytest.mark.every(2)
@pytest.mark.parametrize("integrator", ["DOP853", "rk4"])
def test_members_are_single_runs(integrator: str) -> None:
    """To the bit, with rows and outputs."""
    options = {**QUICK, "integrator": integrator, "samples": 11}
    if integrator == "rk4":
        options = {"t_end": 1.0, "integrator": "rk4", "dt": 0.01, "samples": 11}
    found = eomgen.ensemble(
        "two_body_forced",
        {"m_A": MASSES, "tau": (0.0, 0.2, -0.3)},
        outputs=("kinetic_energy", "body_poses"),
        **options,
    )
    assert found.finished.all() and found.rows is not None and len(found) == 3
    for i, (mass, torque) in enumerate(found.design.values.tolist()):
        run = eomgen.simulate(
            "two_body_forced", parameters={"m_A": mass}, inputs={"tau": torque}, **options
        )
        assert found.rows[i].tobytes() == run.y.tobytes()
        assert found.times.tolist() == run.t.tolist()
        assert found.of("kinetic_energy")[i] == run.motion.kinetic_energy[-1]
    assert found.outputs["body_poses"].shape[:2] == (3, 11)
    assert found.of("theta").tolist() == found.rows[:, -1, found.states.index("theta")].tolist()


def test_states_are_varied() -> None:
    """An initial state is that of the scene with the value put in; quaternions are normalised."""
    found = eomgen.ensemble("pendulum", {"theta": (0.1, 0.2)}, samples=3, **QUICK)
    assert found.rows is not None and found.rows[:, 0, 0].tolist() == [0.1, 0.2]
    turned = eomgen.ensemble("tumbling_body", {"nut_qw": (0.5,)}, samples=3, **QUICK)
    assert turned.rows is not None
    parts = turned.rows[0, 0, [name.startswith("nut_q") for name in turned.states]]
    assert np.linalg.norm(parts) == pytest.approx(1.0, abs=1e-15)


def test_nothing_depends_on_who_runs_it(tmp_path: Path) -> None:
    """In Python, one process or two, kept in a folder or not: the same bytes."""
    design = eomgen.grid({"m_A": np.linspace(0.5, 2.0, 3), "theta": np.linspace(-1.0, 1.0, 3)})
    runs = [
        eomgen.ensemble("two_body", design, outputs=("momentum",), backend="numpy", **QUICK, **own)
        for own in ({}, {"workers": 2}, {"folder": tmp_path / "kept"})
    ]
    assert all(same(runs[0], run) for run in runs[1:])
    assert runs[0].on_grid("theta").shape == (3, 3)
    assert runs[0].on_grid("momentum").shape[:2] == (3, 3)


TOGETHER: dict[str, Any] = {"integrator": "rk4", "dt": 0.01, "t_end": 0.5, "backend": "c"}
STOPS = """
name = "wheel"
parameters = { w = 0.01, k = 400.0 }
bodies = [{ name = "disc", mass = 1.0, inertia_com = 0.4 }]
initial = { q = [0.0], v = [3.0] }
effects = [{ type = "motor", name = "stops", joint = "axle", torque = "push" }]
[[joints]]
name = "axle"
type = "revolute"
parent = "world"
child = "disc"
coordinate = "q"
"""
STOPS = STOPS.replace(
    "push", "-k*max(0, q - 1) + k*max(0, -1 - q) + (300.0 if abs(q - 0.3) < w else 0)"
)
"""Two stops, and a push in a place that long steps pass over."""
COMPILED = pytest.mark.skipif(CC is None, reason="there is no C compiler")


@pytest.mark.every(2)
@COMPILED
@pytest.mark.parametrize("asked", [TOGETHER, {**QUICK, "backend": "c", "samples": 7}])
def test_members_that_run_together(asked: Any, tmp_path: Path) -> None:
    """In one thread or two, kept in a folder or not: the same bytes."""
    design = eomgen.grid({"m_A": np.linspace(0.5, 2.0, 30), "theta": np.linspace(-1.0, 1.0, 10)})
    runs = [
        eomgen.ensemble("two_body", design, outputs=("momentum",), **asked, **options)
        for options in ({}, {"workers": 2}, {"folder": tmp_path / "kept"})
    ]
    assert all(same(runs[0], run) for run in runs[1:])
    alone = eomgen.ensemble("two_body", {"m_A": [design.values[7, 0]]}, **asked)
    assert alone.finished.all()


@pytest.mark.every(2)
@COMPILED
@pytest.mark.parametrize(
    ("scene", "name", "asked"),
    [
        ("pendulum", "theta", {"integrator": "Rodas5P", "rtol": 1e-6}),
        ("four_bar", "theta_dot", {"integrator": "gauss_4", "dt": 0.01}),
        ("bouncing_two_body", "m_B", {"integrator": "rk4", "dt": 2e-3, "t_end": 0.9}),
        ("bouncing_two_body", "m_B", {"integrator": "gauss_4", "dt": 2e-3, "t_end": 0.9}),
    ],
)
def test_compiled_members_run_in_threads(
    scene: str, name: str, asked: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By stiff methods, with loops, and with rigid contacts; once compiled, the program is not read
    again.
    """
    asked = {"t_end": 0.2, "backend": "c", **asked}
    vary = {name: np.linspace(0.5, 1.5, 6)}
    one = eomgen.ensemble(scene, vary, **asked)
    assert one.finished.all()
    members._prepared.cache_clear()
    monkeypatch.setattr(execute, "by_processes", pytest.fail)
    monkeypatch.setattr(accelerator, "interfaced_program_of", pytest.fail)
    assert same(one, eomgen.ensemble(scene, vary, workers=2, **asked))


@pytest.mark.every(2)
@COMPILED
@pytest.mark.parametrize("method", THROUGH_EVENTS)
@pytest.mark.parametrize(
    ("scene", "vary"),
    [
        (BLOCK, {"block_y": [0.1, 0.3 * np.sin(0.2)], "lift": [0.0, 8.5]}),
        (STOPS, {"w": [0.002, 0.02], "q": [0.0, -0.5]}),
    ],
    ids=["contacts", "branches"],
)
def test_compiled_members_go_through_events(
    method: str, scene: str, vary: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By adaptive methods, in threads: strikes, contacts that are held, steps that pass over a
    branch and are made again; in C alone, with the bits of single runs. One begins with a strike,
    at the time of a row.
    """
    asked = {"t_end": 1.0, "samples": 9, "integrator": method, "rtol": 1e-6}
    python = eomgen.ensemble(scene, vary, backend="numpy", **asked)
    monkeypatch.setattr(members, "integrate", pytest.fail)
    monkeypatch.setattr(execute, "by_processes", pytest.fail)
    assert same(python, eomgen.ensemble(scene, vary, workers=2, backend="c", **asked))


@pytest.mark.parametrize("asked", [QUICK, pytest.param(TOGETHER, marks=COMPILED)])
def test_what_was_stopped_goes_on(
    asked: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Chunks that are whole are not run again; lost, damaged and foreign ones are."""
    asked = {"backend": "numpy", **asked}
    count = 40 if asked["backend"] == "numpy" else 1200
    folder, angles = tmp_path / "kept", np.linspace(0, 1, count)
    design = eomgen.grid({"m_A": np.linspace(0.5, 2.0, count)})
    whole = eomgen.ensemble("pendulum", {"theta": angles}, folder=folder, **asked)
    files = sorted(folder.iterdir())
    before = {path.name: path.read_bytes() for path in files}
    chunks = [path for path in files if path.name.startswith("chunk_")]
    each = count // len(chunks)
    assert len(chunks) in (38, 40)
    chunks[3].unlink()
    chunks[5].write_bytes(chunks[5].read_bytes()[:-40])
    chunks[7].write_bytes(chunks[8].read_bytes())  # another chunk's
    with (folder / "t.npy").open("r+b") as file:
        file.seek(-8 * (count - 9 * each), os.SEEK_END)
        file.write(b"1")
    ran: list[int] = []
    once = together.run_chunk
    monkeypatch.setattr(execute, "run_chunk", lambda *a: ran.append(1) or once(*a))
    again = eomgen.ensemble("pendulum", {"theta": angles}, folder=folder, **asked)
    assert len(ran) == 4 and same(whole, again)
    assert {path.name: path.read_bytes() for path in sorted(folder.iterdir())} == before
    with pytest.raises(RunError, match="holds another sweep; remove it, or choose another"):
        eomgen.ensemble("two_body", design, folder=folder, **asked)
    with pytest.raises(RunError, match="is not an empty folder"):
        eomgen.ensemble("two_body", design, folder=tmp_path, **asked)


def test_angles_are_varied_in_degrees_too() -> None:
    """A grid, a list and a sample named in degrees are the same design in radians."""
    degrees = np.array([0.0, 45.0, 90.0])
    for by_degrees, by_radians in (
        (eomgen.grid({"theta_deg": degrees}), eomgen.grid({"theta": np.radians(degrees)})),
        ({"theta_deg": degrees}, {"theta": np.radians(degrees)}),
        (
            eomgen.sampled({"theta_dot_deg": ("uniform", -180.0, 180.0)}, 3),
            eomgen.sampled({"theta_dot": ("uniform", -np.pi, np.pi)}, 3),
        ),
    ):
        found, expected = (
            eomgen.ensemble("pendulum", vary, t_end=0.5) for vary in (by_degrees, by_radians)
        )
        assert found.design.names == expected.design.names
        assert np.allclose(found.design.values, expected.design.values, rtol=1e-15)
        assert all(map(np.allclose, found.design.axes, expected.design.axes))
        assert np.allclose(found.final, expected.final, rtol=1e-9)


def test_a_full_disk_keeps_what_has_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line says so, and the sweep goes on when there is space."""
    vary, asked = {"theta": np.linspace(0, 1, 6)}, {"backend": "numpy", **QUICK}
    left, write = [3], storage.write_whole

    def filling(path: Path, data: str, **options: Any) -> None:
        left[0] -= path.name.startswith("chunk_")
        if left[0] < 0:
            raise RunError(f"{path}: cannot be written: No space left on device")
        write(path, data, **options)

    with monkeypatch.context() as patch:
        patch.setattr(storage, "write_whole", filling)
        said = "No space left on device; other chunks are kept, and the same sweep goes on"
        with pytest.raises(RunError, match=said):
            eomgen.ensemble("pendulum", vary, folder=tmp_path / "kept", **asked)
    assert storage.kept_members(tmp_path / "kept") == 3
    again = eomgen.ensemble("pendulum", vary, folder=tmp_path / "kept", **asked)
    assert same(again, eomgen.ensemble("pendulum", vary, **asked))
    assert storage.kept_members(tmp_path / "kept") == 6


def started(out: Path, members: int, t_end: float, chunks: int) -> "subprocess.Popen[str]":
    """A sweep in two processes that has finished so many chunks."""
    command = [sys.executable, "-m", "eomgen", "sweep", "pendulum", "--workers", "2"]
    command += f"--vary theta=0:1:{members} --t-end {t_end} --backend numpy -o {out}".split()
    process = subprocess.Popen(
        command, start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    due = time.monotonic() + 60
    while len(list(out.glob("*/chunk_*"))) < chunks and time.monotonic() < due:
        time.sleep(0.01)
    return process


@pytest.mark.apart
def test_a_killed_sweep_goes_on(tmp_path: Path) -> None:
    """Killed at any time, its workers end with it, also within a run; and it ends with the bytes of
    one that was not.
    """
    one, two = tmp_path / "one", tmp_path / "two"
    process = started(one, 14, 10, 3)
    process.kill()
    process.communicate(timeout=10)  # ends when nobody can write to its pipes any more
    kept = len(list(one.glob("*/chunk_*")))
    assert 3 <= kept < 14 and not (one / "pendulum_sweep.csv").exists()
    for place in (one, two):
        command = f"sweep pendulum --vary theta=0:1:14 --t-end 10 --backend numpy -o {place}"
        assert main(command.split()) == 0
    files = [sorted(path.relative_to(w) for path in w.rglob("*.*")) for w in (one, two)]
    assert files[0] == files[1] and len(files[0]) == 20
    for name in files[0]:
        assert (one / name).read_bytes() == (two / name).read_bytes(), name


@pytest.mark.apart
@pytest.mark.every(2)
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_two_stops_at_once(number: signal.Signals, tmp_path: Path) -> None:
    """To the process and to its group, as `timeout` sends them: one line, and no hang."""
    process = started(tmp_path, 60, 20, 2)
    process.send_signal(number)
    time.sleep(0.05)
    os.killpg(process.pid, number)
    said = process.communicate(timeout=20)[1]
    assert process.returncode == 128 + number and said.count("\n") == 1, said
    assert said.startswith("eomgen: pendulum: interrupted; ")


def test_a_member_that_fails_is_a_row(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One is refused, one stops on its way; the others are as they would be alone."""
    options = {"t_end": 4.0, "integrator": "rk4", "dt": 0.05, "samples": 9, "workers": 1}
    found = eomgen.ensemble(
        "pendulum", {"theta_dot": (0.0, 1e308, 1.0), "bob_mass": (1.0, 1.0, -1.0)}, **options
    )
    assert found.status == ["finished", "stopped", "refused"]
    assert (
        found.rows is not None
        and np.isnan(found.rows[2]).all()
        and np.isnan(found.rows[1, -1]).all()
    )
    assert not found.messages[0] and "stopped at t = " in found.messages[1] and found.messages[2]
    assert found.quantiles("theta").shape == (3, 9)
    assert np.isfinite(found.quantiles("theta")).all()
    assert (
        main(f"sweep pendulum --vary bob_mass=-1,1 --t-end 1 --workers 1 -o {tmp_path}".split())
        == 0
    )
    said = capsys.readouterr().out
    assert "2 runs, bob_mass varied; 1 finished" in said and "run 0 refused: " in said
    table = (tmp_path / "pendulum_sweep.csv").read_text("utf-8")
    rows = list(csv.DictReader(table.splitlines()))
    assert [row["status"] for row in rows] == ["refused", "finished"]
    assert rows[0]["theta (end)"] == "nan" and math.isfinite(float(rows[1]["theta (end)"]))


def test_samples_follow_their_laws() -> None:
    """Their quantiles do; a longer sample begins with the shorter one, another seed is another."""
    laws = {"a": ("uniform", -1.0, 3.0), "b": ("normal", 2.0, 0.5), "c": ("loguniform", 0.1, 10.0)}
    design = eomgen.sampled(laws, 20_000, seed=3)
    expected = {
        "a": (0.0, 1.0, 2.0),
        "b": (2 - 0.33724, 2.0, 2 + 0.33724),
        "c": (10**-0.5, 1.0, 10**0.5),
    }
    for i, name in enumerate(design.names):
        found = np.quantile(design.values[:, i], (0.25, 0.5, 0.75))
        assert found == pytest.approx(expected[name], abs=0.05), name
    assert np.corrcoef(design.values.T)[0, 1] == pytest.approx(0.0, abs=0.03)
    shorter = eomgen.sampled(laws, 100, seed=3)
    assert np.array_equal(shorter.values, design.values[:100])
    assert not np.array_equal(shorter.values, eomgen.sampled(laws, 100, seed=4).values)
    assert np.isfinite(Law("normal", 0.0, 1.0).at(np.array([0.0, 0.5]))).all()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("", "--vary: name what is varied"),
        ("--vary m", "--vary m: write NAME=LOW:HIGH:COUNT"),
        (
            "--vary bob_mass=1:2",
            "=1:2: write LOW:HIGH:COUNT, or A,B,… for single values",
        ),
        ("--vary bob_mass=1:2:0", "0 is not a number of values"),
        ("--vary bob_mass=1:2:2.5", "2.5 is not a number of values"),
        ("--vary bob_mass=-1:2:3:log", "a logarithmic axis needs positive ends"),
        ("--vary bob_mass=a,b", "'a' is not a finite number; write LOW:HIGH:COUNT"),
        ("--vary bob_mass=1,nan", "'nan' is not a finite number; write LOW:HIGH:COUNT"),
        ("--vary theta=1 --vary theta_deg=2", "an angle is given twice"),
        ("--vary q=1,2", "--vary: no parameter, state or input 'q'"),
        ("--vary bob_mass=1,2 --vary bob_mass=3,4", "a name is given twice"),
        (
            "--vary bob_mass=1,2 --set bob_mass=1",
            "is also given a fixed value; leave one out",
        ),
        ("--vary bob_mass=normal:1:0 --sample 3", "give a mean and a positive deviation"),
        ("--vary bob_mass=2:1 --sample 3", "give two numbers, the smaller first"),
        ("--vary bob_mass=odd:1:2 --sample 3", "'odd' is not a distribution"),
        ("--vary bob_mass=1:2 --sample 0", "--sample: 0 is not a number from 1 to"),
        ("--vary bob_mass=1:2 --sample 2 --seed -1", "--seed: -1 is negative"),
        ("--vary bob_mass=1,2 --of x", "--of: unknown name 'x'"),
        (
            "--vary bob_mass=1,2 --outputs inverse_dynamics",
            "no output 'inverse_dynamics'",
        ),
        ("--vary bob_mass=1,2 --outputs all", "--outputs: name the functions to compute"),
        (
            "--vary bob_mass=1,2 --workers 0",
            "--workers: 0 is not a number of processes; give 1 or more",
        ),
        ("--vary bob_mass=1,2 --samples 1", "samples: 1 is too few"),
        ("--vary bob_mass=1,2 --t-end -1", "--t-end: -1 is not a positive time"),
        ("--vary bob_mass=1,2 --rtol 1e-20", "rtol: 1e-20 is too small"),
        ("--vary bob_mass=1,2 --dt 0.1", "dt: DOP853 chooses its own steps"),
        ("--vary bob_mass=1,2 --max-step -1", "max_step: -1 is not a positive step"),
        ("--vary bob_mass=1,2 --backend x", "--backend: 'x' is not one of auto, numpy, c"),
        ("--vary bob_mass=1:2:30000000", "is not a number of values from 1 to"),
    ],
)
def test_one_mistake_one_line(
    options: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(f"sweep pendulum {options} -o {tmp_path} --integrator DOP853".split()) == 1
    words = capsys.readouterr().err
    assert said in words and words.count("\n") == 1


def test_figures_fit_what_is_varied() -> None:
    """A heat map over two, a curve over one, a histogram of a sample; a fan if rows are kept."""

    def drawn(vary: Any, **options: Any) -> Figure:
        return draw_sweep(eomgen.ensemble("pendulum", vary, **QUICK, **options), "theta")

    two = drawn(eomgen.grid({"bob_mass": (1.0, 2.0), "theta": (0.1, 0.2, 0.3)}))
    assert [axes.get_ylabel() for axes in two.axes] == [
        "$\\mathrm{bob}_{\\mathrm{mass}}$ in kg",
        "$\\theta$ in rad at t = 1 s",
    ]
    one = drawn(eomgen.grid({"bob_mass": (2.0, 1.0)}), samples=5)
    assert one.axes[0].get_lines()[0].get_xdata().tolist() == [1.0, 2.0]
    assert one.axes[1].get_xlabel() == "t in s" and len(one.axes[1].get_lines()) == 3
    some = drawn(
        eomgen.sampled({"bob_mass": ("uniform", 1.0, 2.0), "gravity_g": ("normal", 9.8, 0.1)}, 30)
    )
    assert sum(bar.get_height() for bar in some.axes[0].patches) == 30


def test_members_that_did_not_finish_are_seen() -> None:
    """As grey cells, crosses on the border of a curve, and at the last rows of trajectories."""
    vary = eomgen.grid({"bob_mass": (-1.0, 1.0, 2.0), "theta": (0.1, 0.2)})
    cells = draw_sweep(eomgen.ensemble("pendulum", vary, **QUICK), "theta")
    assert cells.axes[0].collections[0].get_array().mask.tolist() == [
        [True] * 2,
        *[[False] * 2] * 2,
    ]
    assert cells.axes[0].get_legend().get_texts()[0].get_text() == "not finished"
    fixed: dict[str, Any] = {"t_end": 4.0, "integrator": "rk4", "dt": 0.05, "samples": 9}
    found = eomgen.ensemble("pendulum", eomgen.grid({"theta_dot": (0.0, 1.0, 1e308)}), **fixed)
    curve, fan = draw_sweep(found, "theta").axes
    assert curve.get_lines()[1].get_xdata().tolist() == [1e308]
    assert 0 < fan.get_lines()[-1].get_xdata()[0] < 4


def test_statistics_are_those_of_members_with_a_value(tmp_path: Path) -> None:
    """Of states and outputs at each time, computed in parts or not, and in the file."""
    asked: dict[str, Any] = {"t_end": 4.0, "integrator": "rk4", "dt": 0.05, "samples": 9}
    speeds = [0.0, 1.0, 1e308, 2.0, 3.0]
    outputs = ("kinetic_energy", "momentum")
    found = eomgen.ensemble("pendulum", {"theta_dot": speeds}, outputs=outputs, **asked)
    for name, values in (
        ("theta", found.rows[:, :, 0] if found.rows is not None else None),
        ("kinetic_energy", found.outputs["kinetic_energy"]),
    ):
        assert values is not None
        each = found.statistics(name, (0.0, 0.5))
        good = values[[0, 1, 3, 4], 4:]
        assert each.members[4:].tolist() == [4] * 5 and each.times.tolist() == found.times.tolist()
        assert np.allclose(each.mean[4:], good.mean(axis=0), rtol=1e-14, atol=0)
        assert np.allclose(each.deviation[4:], np.std(good, axis=0, ddof=1), rtol=1e-13, atol=0)
        assert np.allclose(each.quantiles[1, 4:], np.median(good, axis=0), rtol=1e-15, atol=0)
        assert each.quantiles[0, 4:].tolist() == good.min(axis=0).tolist()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(ensemble, "MOST_NUMBERS", 2 * len(speeds))
            parts = found.statistics(name, (0.0, 0.5))
        for one, other in zip(each[1:], parts[1:], strict=True):
            assert np.array_equal(one, other, equal_nan=True)
    # Speeds of 0, 1, 2, 3 and 1e308 rad/s deviate by 1e308/sqrt(5).
    start = found.statistics("theta_dot")
    assert start.members[0] == 5 and start.mean[0] == pytest.approx(2e307)
    assert start.deviation[0] == pytest.approx(1e308 / math.sqrt(5))
    with pytest.raises(RunError, match="momentum is not a state or an output with one number"):
        found.statistics("momentum")
    ends = eomgen.ensemble("pendulum", {"theta": [0.1, 0.2]}, **QUICK).statistics("theta")
    assert ends.times.tolist() == [1.0] and ends.members.tolist() == [2]
    path = tmp_path / "statistics.csv"
    save_statistics(found, path)
    rows = list(csv.DictReader(path.read_text("utf-8").splitlines()))
    assert len(rows) == 9 * 3 and rows[5]["unit"] == "rad"
    assert float(rows[5]["mean"]) == found.statistics("theta").mean[5]


def test_a_table_in_parts_is_the_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = eomgen.ensemble("pendulum", {"bob_mass": [1.0, -1.0, 2.0, 3.0, 4.0]}, **QUICK)
    for size in (4096, 2):
        monkeypatch.setattr(saving, "TABLE_PART", size)
        save_sweep(found, "theta", tmp_path / f"{size}.csv", tmp_path / "a.png", force=True)
    assert (tmp_path / "2.csv").read_bytes() == (tmp_path / "4096.csv").read_bytes()
    rows = list(csv.DictReader((tmp_path / "2.csv").read_text("utf-8").splitlines()))
    assert [row["member"] for row in rows] == list("01234") and rows[1]["message"]
