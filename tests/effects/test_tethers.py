"""Strings that are taut or slack, against closed forms."""

import math

import numpy as np
import pytest
from scenes import refusal

import eomgen
from eomgen.scene.reader import parse_scene

G = 9.81
BOB = """
name = "bob"
bodies = [{ name = "bob", mass = 2.0 }]
joints = [{ name = "flight", type = "particle", parent = "world", child = "bob" }]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "tether", name = "leash", length = 1.0, restitution = RESTITUTION, through = [
        { body = "world" }, { body = "bob" },
    ] },
]
"""


def bob(restitution: float, q: str, v: str = "") -> str:
    """A bob on a string of 1 m."""
    start = f"[initial]\nq = {{ {q} }}\nv = {{ {v} }}\n"
    return BOB.replace("RESTITUTION", str(restitution)) + start


def test_a_string_becomes_taut_with_an_impulse() -> None:
    """A bob falls beside its anchor: the string takes its speed along itself, or turns a part."""
    x = 0.6
    fall = math.sqrt(2 * G * 0.8)
    for restitution in (0.0, 0.5):
        text = bob(restitution, f"bob_x = {x}, bob_y = 0.0")
        run = eomgen.simulate(parse_scene(text), t_end=0.5, rtol=1e-10, samples=401)
        first = run.trajectory.events[0]
        assert (first.contact, first.kind) == ("leash", "impact")
        assert first.t == pytest.approx(math.sqrt(2 * 0.8 / G), rel=1e-9)
        before, after = run.t < first.t, run.t > first.t
        states = dict(zip(run.states, run.y.T, strict=True))
        assert states["bob_y"][before][-1] > -0.8 > states["bob_y"][after][0] - 1e-2
        along = np.array([0.6, -0.8])
        across = np.array([0.8, 0.6])
        velocity = np.array([0.0, -fall])
        kept = across * (across @ velocity) - restitution * along * (along @ velocity)
        energy = run.energy[after][0] - run.energy[before][-1]
        assert energy == pytest.approx(kept @ kept - velocity @ velocity, rel=1e-6)
        reach = np.hypot(states["bob_x"], states["bob_y"])
        assert reach.max() < 1 + 1e-9
        if not restitution:
            assert reach[after] == pytest.approx(1.0, abs=1e-8)


def test_a_string_becomes_slack() -> None:
    """On a circle with v² = 4 g l at the lowest point it does at cos φ = -2/3, where the tension is
    0; then the bob flies freely.
    """
    text = bob(0.0, "bob_x = 0.0, bob_y = -1.0", f"bob_x_dot = {math.sqrt(4 * G)}")
    run = eomgen.simulate(parse_scene(text), t_end=0.85, rtol=1e-10, samples=1001)
    lift = next(event for event in run.trajectory.events if event.kind == "lift")
    states = dict(zip(run.states, run.y.T, strict=True))
    height = np.interp(lift.t, run.t, states["bob_y"])
    assert height == pytest.approx(2 / 3, abs=1e-5)
    free = (run.t > lift.t + 1e-3) & (run.t < lift.t + 0.1)
    fitted = np.polyfit(run.t[free], states["bob_y"][free], 2)[0]
    assert fitted == pytest.approx(-G / 2, rel=1e-6)


def test_a_string_turns_no_disc() -> None:
    """Rather the constraint does."""
    text = bob(0.0, "bob_x = 0.1").replace(
        '{ body = "world" }', '{ body = "world", radius = 0.1, winds = "clockwise" }'
    )
    assert "effects[1].through[0].radius: a string that may be slack turns no disc" in refusal(text)
