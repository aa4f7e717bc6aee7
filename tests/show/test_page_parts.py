"""Parts of the page that need no browser, run by node: numbers, channels, samples, tables."""

import math
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live import NODE, run_in_node

from eomgen.api.given import model_of, read
from eomgen.pipeline import compile_program, python_module
from eomgen.run.module import load_module
from eomgen.run.trajectory import COUNTS, Trajectory, save_csv
from eomgen.show.live import live_table
from eomgen.store import live_code

PARTS = ("numbers.js", "downloads.js", "plots_channels.js", "plots_samples.js", "recording.js")
pytestmark = pytest.mark.skipif(NODE is None, reason="needs node, which runs JavaScript")

# A mechanism whose results are known and, as generated ones, reused by the next call.
FAKE = """
const [pose, twist, wrench, load] = given.dimensions === 3 ? [12, 6, 6, 9] : [3, 3, 3, 5];
const filled = (count) => {
  const values = new Float64Array(count);
  return (t, y, p, u) => {
    for (let k = 0; k < count; k += 1) {
      values[k] = y[0] * p[0] * Math.sin(k + 1) + y[1] * t + u[0];
    }
    return values;
  };
};
const data = {
  name: "fake", dimensions: given.dimensions,
  bodies: ["arm", "hand"], joints: ["hinge", "wrist"], parameters: [], effects: [],
  states: given.states.map((name, k) => ({ name, unit: k ? "rad/s" : "rad" })),
  loads: [{ effect: "spring", body: "arm" }, { effect: "spring", body: "arm" }],
  inputs: [{ name: "push", unit: "N", value: 0 }], pointer: { first: 1, perBody: 6 },
};
const mechanism = {
  kineticEnergy: (t, y) => y[1] ** 2 / 2,
  potentialEnergy: (t, y, p) => 1 - Math.cos(y[0]) * p[0],
  bodyPoses: filled(2 * pose), bodyVelocities: filled(2 * twist),
  jointForces: filled(2 * wrench), loads: filled(2 * load),
  contacts: [{ name: "foot", effect: "ground", unit: "m" }], gaps: (t, y) => [y[0]],
  gapRates: () => { throw new Error("no value"); },
};
const channels = makeChannels(data, mechanism);
"""


def in_node(script: str, given: Any = None, source: str = "") -> Any:
    """What the body of a function returns from these parts of the page."""
    return run_in_node(source, script, given, seconds=60, scripts=PARTS)


TEXTS = [
    ((3.0e-23, "J", 1), "0 J"),
    ((3.0e-23, "J", 0), "3.000×10⁻²³ J"),
    ((-1.23456, "rad"), "−1.235 rad"),
    ((0.0, "m"), "0 m"),
    ((-0.0,), "0"),
    ((12345.6, "N/m"), "12346 N/m"),
    ((99999.9, "Pa"), "1.000×10⁵ Pa"),
    ((0.000999999, "m^2"), "0.001000 m²"),
    ((9.99949e-4,), "9.999×10⁻⁴"),
    ((-1.2e-5, "kg m^2/s", 1), "−1.200×10⁻⁵ kg m²/s"),
    ((1e-12, "N/m^1.5", 0.1), "1.000×10⁻¹² N/m^1.5"),
    ((None, "J"), "–"),
    ((5, "1"), "5.000"),
]


def test_numbers_read_like_numbers() -> None:
    found = in_node("return given.map((row) => numbers.text(...row));", [row for row, _ in TEXTS])
    assert [text.replace("\u00a0", " ") for text in found] == [text for _, text in TEXTS]
    assert " " not in "".join(found)  # a number and its unit stay on one line


def test_numbers_have_four_digits() -> None:
    draw = random.Random(21)
    values = [draw.choice((-1, 1)) * 10 ** draw.uniform(-30, 30) for _ in range(3000)]
    texts = in_node("return given.map((x) => numbers.text(x));", values)
    raised = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
    for value, text in zip(values, texts, strict=True):
        read = float(text.translate(raised).replace("×10", "e"))
        assert math.isclose(read, value, rel_tol=5.001e-4), (value, text)


def test_marks_of_an_axis_tell_its_steps_apart() -> None:
    steps = [0.1, 0.25, 2.5, 20000, 500000, 2.5e-7]
    script = "return given.map((d) => numbers.ticks([-d, 0, d, 2 * d, 3 * d], d));"
    for step, found in zip(steps, in_node(script, steps), strict=True):
        read = [float(text.replace("−", "-")) * 10 ** found["exponent"] for text in found["texts"]]
        np.testing.assert_allclose(read, step * np.arange(-1, 4), rtol=1e-9, atol=0)


def test_tables_are_those_of_simulate(tmp_path: Path) -> None:
    draw = random.Random(7)
    states = ('a "quoted", name', "w.x")
    values = [draw.choice((-1, 1)) * 10 ** draw.uniform(-320, 308) for _ in range(1000)]
    values += [0.0, -0.0, 1.0, 1e16, 123456789012345680.0, 1e-5, 9.5e-5, 1e-4, 5e-324, 1e22, -100.0]
    values += values[: len(values) % 2]
    y = np.array(values).reshape(-1, 2)
    t = np.sort([draw.uniform(0, 9) for _ in y])
    t[5:8] = t[5]  # two impacts at one time
    run = Trajectory("fake", states, t, y, "rk4", True, "", dict.fromkeys(COUNTS, 0))
    save_csv(run, tmp_path / "run.csv")
    script = f"""{FAKE}
    const recorder = makeRecorder(data, channels);
    recorder.start();
    given.t.forEach((t, i) => recorder.append(t, given.y[i], [1], [0]));
    const keys = ["{states[1]}", "energy", "speed.arm"];
    return [recorder.table(), recorder.rows, recorder.table(recorder.samples, keys)];"""
    table, rows, more = in_node(
        script, {"dimensions": 2, "states": states, "t": t.tolist(), "y": y.tolist()}
    )
    assert table == (tmp_path / "run.csv").read_text("utf-8")
    assert rows == len(t)
    assert more.splitlines()[0] == table.splitlines()[0] + ",energy,speed_arm"


def test_a_record_ends_where_the_run_begins_again() -> None:
    script = f"""{FAKE}
    const recorder = makeRecorder(data, channels, {{ megabytes: given.megabytes }});
    recorder.append(0, [9, 9], [1], [0]);
    recorder.start();
    for (const t of given.t) recorder.append(t, [t, 1], [1], [0]);
    return [recorder.rows, recorder.recording, recorder.full];"""
    given = {"dimensions": 2, "states": ["q", "w"], "megabytes": 1}
    assert in_node(script, {**given, "t": [0, 1, 2, 0.5, 3]}) == [3, False, False]
    rows, recording, full = in_node(script, {**given, "t": list(range(60000))})
    assert not recording
    assert full
    assert rows == 131072 // 3 + 1


@pytest.mark.parametrize("dimensions", [2, 3])
def test_channels_of_a_live_run_that_slides(dimensions: int) -> None:
    script = f"""{FAKE}
    const keys = channels.list.map((c) => c.key);
    const samples = makeSamples(channels, {{ span: 2, spacing: 0.01 }});
    const early = keys.slice(0, 5);
    for (let i = 0; i <= 2000; i += 1) {{
      const t = i * 0.005;
      const [p, u] = [t < 9 ? 2 : 3, t < 9.5 ? 0 : 1];
      samples.append(t, [Math.cos(t), Math.sin(3 * t)], [p], [u], t > 9.9);
      if (i % 97 === 0) samples.columns(early); // some are computed on the way
      if (i % 311 === 0) samples.columns(keys.slice(6, 20));
    }}
    const columns = samples.columns(keys);
    return {{
      t: Array.from(samples.times()), labels: channels.list.map((c) => c.label),
      columns: Object.fromEntries(keys.map((key, k) => [key, Array.from(columns[k])])),
      row: samples.rowAt(8.7031), none: makeSamples(channels).rowAt(1),
      scale: samples.scale("energy"),
    }};"""
    found = in_node(script, {"dimensions": dimensions, "states": ["q", "w"]})
    t = np.array(found["t"])
    np.testing.assert_allclose(t, np.arange(800, 1001) * 0.01, atol=1e-9)
    q, w = np.cos(t), np.sin(3 * t)
    p, u, held = np.where(t < 9, 2, 3), np.where(t < 9.5, 0, 1), t > 9.9

    def entry(k: int) -> Any:
        return q * p * np.sin(k + 1) + w * t + u

    def length(*ks: int) -> Any:
        return np.sqrt(sum(entry(k) ** 2 for k in ks))

    energy = w**2 / 2 + 1 - np.cos(q) * p
    space = dimensions == 3
    expected = {
        "q": q,
        "w": w,
        "inputs.push": u,
        "kinetic_energy": w**2 / 2,
        "energy": energy,
        "energy_change": energy - (1 - 2 * np.cos(1)),
        "gaps.foot": q,
        "gap_rates.foot": np.full_like(t, np.nan),
        "body_poses.hand.y": entry(19 if space else 4),
        "speed.hand": length(6, 7, 8) if space else length(3, 4),
        "body_velocities.hand.vy": entry(7 if space else 4),
        "body_velocities.hand.wz": entry(11 if space else 5),
        "joint_forces.wrist": np.where(held, np.nan, length(6, 7, 8) if space else length(3, 4)),
        "joint_forces.wrist.mz": np.where(held, np.nan, entry(11 if space else 5)),
        "loads.spring.arm.2.force": length(12, 13, 14) if space else length(7, 8),
        "loads.spring.arm.torque": length(6, 7, 8) if space else length(4),
    }
    if space:
        expected["angular_speed.arm"] = length(3, 4, 5)
        expected["body_poses.arm.z"] = entry(11)
    for key, values in expected.items():
        column = np.array(found["columns"][key], dtype=float)
        np.testing.assert_allclose(column, values, rtol=1e-12, atol=1e-12, err_msg=key)
    assert len(set(found["labels"])) == len(found["labels"])
    assert found["row"]["t"] == pytest.approx(8.70)
    assert found["none"] is None
    assert 0.9 < found["scale"] < 5


def test_forces_of_joints_are_unknown_while_a_contact_is_held() -> None:
    script = f"""{FAKE}
    const [t, y] = [Float64Array.of(0, 1, 2, 3, 4, 5, 6), new Float64Array(14).fill(1)];
    const known = (...held) => {{
      const samples = makeSamples(channels);
      samples.set(t, y, [1], [0], ...held);
      return samples.columns(["joint_forces.hinge"]).flatMap((x) => Array.from(x, Number.isFinite));
    }};
    const now = given.events.map((_, i) => channels.heldAfter(given.events.slice(0, i + 1)));
    const growing = [];
    for (const event of given.events) growing.push(event), now.push(channels.heldAfter(growing));
    return [known(channels.heldAt(t, given.events)), known(), now];"""
    events = [
        {"t": t, "contact": contact, "kind": kind}
        for t, contact, kind in (
            (0.5, "foot", "impact"),
            (1.0, "foot", "rest"),
            (1.5, "hand", "rest"),
            (2.5, "foot", "lift"),
            (3.5, "hand", "lift"),
            (5.5, "foot", "rest"),
        )
    ]
    given = {"dimensions": 3, "states": ["q", "w"], "events": events}
    known, without, now = in_node(script, given)
    assert known == [True, False, False, False, True, True, False]
    assert without == [False] * 7
    assert now == [False, True, True, True, False, True] * 2


def test_a_known_run_is_read_at_any_time() -> None:
    script = f"""{FAKE}
    const samples = makeSamples(channels);
    const t = Float64Array.of(0, 1, 1, 3);
    const y = Float64Array.of(0, 0, 2, 0, 5, 0, 9, 0);
    samples.set(t, y, [1], [0], null, true);
    samples.columns(["energy_change"]);
    const tiny = (of) => numbers.text(1e-7, "J", of.scale("energy_change"));
    const texts = [tiny(samples)];
    samples.set(t, y, [1], [0]);
    samples.columns(["energy_change"]);
    texts.push(tiny(samples));
    const [q] = samples.columns(["q"]);
    const values = [-1, 0, 0.5, 1, 2, 3, 9].map((time) => samples.valueAt(q, time));
    return [values, samples.before(1), samples.scale("q"), texts];"""
    values, before, scale, texts = in_node(script, {"dimensions": 2, "states": ["q", "w"]})
    assert values == [0, 0, 1, 5, 7, 9, 9]
    assert before == 2
    assert scale == 9
    assert texts == ["0\u00a0J", "1.000×10⁻⁷\u00a0J"]  # what was rounded to 24 bits is less precise


WRENCH = {2: ("fx", "fy", "mz"), 3: ("fx", "fy", "fz", "mx", "my", "mz")}
TWIST = {2: ("vx", "vy", "wz"), 3: ("vx", "vy", "vz", "wx", "wy", "wz")}
OUTPUTS = (
    "kinetic_energy",
    "potential_energy",
    "joint_forces",
    "body_poses",
    "body_velocities",
)


@pytest.mark.parametrize("name", ["double_pendulum", "furuta_pendulum"])
def test_channels_are_the_outputs_of_the_module(name: str) -> None:
    """Errors are relative to the largest value of all channels of an output."""
    scene = read(name)
    model = replace(model_of(scene, name), outputs=OUTPUTS)
    system = compile_program(model, jacobian=False, closed=False).system
    module = load_module(python_module(system))
    code = live_code(model_of(scene, name))
    table = live_table(model_of(scene, name), code, scene.simulation)
    y = module.initial_state() + np.random.default_rng(3).normal(size=(8, len(module.STATES)))
    script = """
    const channels = makeChannels(given.data, mechanism);
    const samples = makeSamples(channels);
    const values = (table) => Float64Array.from(table, (x) => x.value);
    const t = Float64Array.from(given.y, (_, i) => i);
    const y = Float64Array.from(given.y.flat());
    samples.set(t, y, values(given.data.parameters), values(given.data.inputs));
    const keys = channels.list.map((c) => c.key);
    return Object.fromEntries(samples.columns(keys).map((x, k) => [keys[k], Array.from(x)]));"""
    found = in_node(script, {"data": table, "y": y.tolist()}, code.source)
    given = {
        output: np.array([getattr(module, output)(0.0, row) for row in y]) for output in OUTPUTS
    }
    expected = {state: y[:, k] for k, state in enumerate(module.STATES)}
    expected |= {output: given[output] for output in OUTPUTS[:2]}
    expected["energy"] = given["kinetic_energy"] + given["potential_energy"]
    for i, joint in enumerate(table["joints"]):
        for k, part in enumerate(WRENCH[model.dimensions]):
            expected[f"joint_forces.{joint}.{part}"] = given["joint_forces"][:, i, k]
    for i, body in enumerate(table["bodies"]):
        for k, part in enumerate(TWIST[model.dimensions]):
            expected[f"body_velocities.{body}.{part}"] = given["body_velocities"][:, i, k]
        poses = given["body_poses"][:, i]
        for k, part in enumerate("xyz"[: model.dimensions]):
            place = poses[:, k, 3] if model.dimensions == 3 else poses[:, k]
            expected[f"body_poses.{body}.{part}"] = place
    for key, values in expected.items():
        size = max(
            np.abs(v).max() for k, v in expected.items() if k.split(".")[0] == key.split(".")[0]
        )
        assert np.abs(np.array(found[key]) - values).max() <= 1e-12 * size, key
