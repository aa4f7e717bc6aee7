"""Controllers that sample have the same samples, to the bit, in every place."""

import ctypes
import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from firmware import Firmware
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from live import NODE, run_in_node

import eomgen
from eomgen.base.errors import RunError

pytestmark = pytest.mark.apart
Array = Any
SPRUNG = """
name = "sprung"
inputs = [{ name = "wish", unit = "N" }]
bodies = [{ name = "cart", mass = 1.0, inertia_com = 0 }]
joints = [{ name = "rail", type = "prismatic", parent = "world", child = "cart", axis = [1, 0] }]
initial = { q = { rail_slide = 0.3 } }
simulation = { t_end = 1.0 }
[[effects]]
type = "joint_spring"
name = "spring"
joint = "rail"
stiffness = 40.0
[[effects]]
type = "motor"
name = "pull"
joint = "rail"
torque = "wish"
[[effects]]
type = "sampled_controller"
name = "hold"
period = 0.02
delay = 0.03
sensors.place = { value = "rail_slide", noise = 0.01, quantum = 1e-3 }
sensors.clock = { value = "t" }
states = { before = { next = "place" }, many = { next = "many + 1" } }
inputs = { wish = "-3*place - 0.5*(place - before)/0.02" }
[[effects]]
type = "sampled_controller"
name = "slow"
period = 0.07
sensors.count = { value = "many", noise = 1.0, quantum = 0.25 }
"""
"""Without sines, whose last digits differ from place to place. Readings are rounded, so that those
of the motion do not matter either."""
SAMPLED = ("place", "clock", "before", "many", "wish", "wish_due_1", "wish_due_2", "count")
X = "rail_slide"
LENGTH = {"t_end": 1.0, "samples": 101}
EQUAL: Any = {"integrator": "rk4", "dt": 1e-3}


@pytest.fixture(scope="module")
def run() -> eomgen.Run:
    return eomgen.simulate(SPRUNG, **LENGTH, **EQUAL)


def test_firmware_has_the_samples_of_a_run(run: eomgen.Run) -> None:
    of = Firmware(SPRUNG, "double", "rk4")
    due = of.library["sprung_next_sample"]
    due.restype = ctypes.c_double
    y, none, clock = (of.array(np.zeros(n)) for n in (of.states, 1, 100))
    of.call("initial_state", 0.0, y, of.k, none, y)
    rows = []
    for n in range(1001):
        if due(ctypes.c_void_p(clock.ctypes.data)) == n / 1000:
            of.call("sample", clock, y, of.k, none)
        rows += [y.copy()] if n % 10 == 0 else []
        of.call("step", n / 1000, 1e-3, y, of.k, none)
    check(run, np.array(rows))


def check(run: eomgen.Run, rows: Array) -> None:
    """Rows (101, ny) have the samples of a run, and its motion but for rounding."""
    for i, name in enumerate(run.trajectory.states):
        if name in SAMPLED:
            assert rows[:, i].tolist() == run[name].tolist(), name
    np.testing.assert_allclose(rows, run.y, atol=1e-9)


@pytest.mark.skipif(NODE is None, reason="needs node")
def test_exported_javascript_has_them(run: eomgen.Run, tmp_path: Path) -> None:
    (module,) = eomgen.export(SPRUNG, "javascript", tmp_path, integrator="rk4")
    script = tmp_path / "run.mjs"
    script.write_text(
        f"""import * as m from "./{module.name}";
let y = m.initial_state();
const at = m.clock(), rows = [];
for (let n = 0; n <= 1000; n += 1) {{
  if (m.nextSample(at) === n / 1000) y = m.sample(at, y);
  if (n % 10 === 0) rows.push(y);
  y = m.step(n / 1000, 1e-3, y);
}}
console.log(JSON.stringify(rows));
"""
    )
    done = subprocess.run([str(NODE), str(script)], capture_output=True, text=True, check=True)
    check(run, np.array(json.loads(done.stdout)))


@pytest.mark.skipif(NODE is None, reason="needs node")
def test_the_page_has_them(run: eomgen.Run) -> None:
    """By rk4 with all bits of the motion; with steps that do not end at samples, too."""
    code = run.page(live=True)
    found = run_in_node(
        code.source,
        """
const [engine, found] = [makeEngine(mechanism, given), []];
for (const [method, dt] of [["rk4", 1e-3], ["DOP853", 5e-3]]) {
  engine.setMethod(method, dt);
  engine.reset();
  const rows = [Array.from(engine.y)];
  while (engine.t < 1 - 1e-9 && !engine.error) {
    engine.step();
    if (Math.abs(engine.t - rows.length / 100) < 1e-12) rows.push(Array.from(engine.y));
  }
  found.push(rows);
}
return found;""",
        code.table,
    )
    assert np.array_equal(found[0], run.y)
    check(run, np.array(found[1]))


@pytest.mark.parametrize("method", ["DOP853", "rk4"])
def test_units_have_them(method: str, run: eomgen.Run, tmp_path: Path) -> None:
    """By their own steps, and as time events of an importer that makes the steps."""
    path = str(eomgen.export(SPRUNG, "fmu", tmp_path / "sprung.fmu", integrator=method)[0])
    assert validate_fmu(path) == []
    given = {"stop_time": 1.0, "output_interval": 0.01, "output": [*SAMPLED, X]}
    found = simulate_fmu(path, fmi_type="CoSimulation", **given)
    np.testing.assert_allclose(found[X], run[X], atol=1e-9)
    if method == "DOP853":
        events = simulate_fmu(path, fmi_type="ModelExchange", relative_tolerance=1e-9, **given)
        last = np.searchsorted(events["time"], np.arange(101) / 100 + 1e-9) - 1
        check_columns(run, {name: events[name][last] for name in SAMPLED})
    check_columns(run, found)


def check_columns(run: eomgen.Run, found: Any) -> None:
    for name in SAMPLED:
        assert found[name].tolist() == run[name].tolist(), name


def test_runs_and_sweeps_by_other_steps_have_them(run: eomgen.Run) -> None:
    swept = eomgen.ensemble(SPRUNG, {"hold_seed": [1.0, 2.0]}, **LENGTH)
    for method in ("DOP853", "Rodas5P", "taylor"):
        check(run, eomgen.simulate(SPRUNG, **LENGTH, integrator=method).y)
    check(run, swept.rows[0])
    assert not np.array_equal(swept.rows[1], swept.rows[0])


def test_what_does_not_sample_says_so(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="'hold' samples, which steps of a stepper do not"):
        eomgen.stepper(SPRUNG, dt=1e-3)
    log = {"t": np.linspace(0, 1, 5), X: np.zeros(5)}
    with pytest.raises(RunError, match="'hold' samples, which fits do not; leave it out"):
        eomgen.fit(SPRUNG, log, ["spring_stiffness"])
    with pytest.warns(UserWarning, match="no exact times of samples: these are left to you"):
        paths = eomgen.export(SPRUNG, "firmware", tmp_path, number="float")
    assert "sprung_sample(" not in paths[0].read_text("utf-8")
