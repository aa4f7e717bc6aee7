"""Where energy goes: what effects do to a motion is what it gains, of every effect; and what their
Jacobians are. Built-in scenes keep to it too: see `test_laws`.

In 60 digits along the motion, as inputs and time have it. What is off by more than 1e-10 of the
terms would be an error of the equations; what is off by less is the rounding of directions that
stand in the scene as doubles.
"""

import numpy as np
import pytest
from bookkeeping import growth, light
from effect_cases import TRIED, Case
from engine import Engine, apart, engine, exact, slopes

from eomgen.tables.outputs import DERIVATIVES, OUTPUTS

EXACT = 1e-14
OTHERS = tuple(name for name in OUTPUTS if name not in DERIVATIVES)
RELAXED = 0.7
"""Extent of states that are neither angles nor places."""
IDLE = ('"impact"', "restitution = 0.5", '"avoid"')
"""Of what has no power: a rigid contact is no load but an event, steering pushes sideways alone."""


def state(made: Engine, rng: np.random.Generator) -> np.ndarray:
    """Angles over a turn, places within 0.6 m, 2 rad/s, 1 m/s, unit quaternions."""
    reach = {"rad": np.pi, "m": 0.6, "rad/s": 2.0, "m/s": 1.0}
    y = np.array([reach.get(s.unit, RELAXED) * rng.uniform(-1, 1) for s in made.system.states])
    for indices in map(list, made.module.QUATERNIONS):
        parts = rng.normal(size=4)
        y[indices] = parts / np.linalg.norm(parts)
    return y


def moments(made: Engine, count: int) -> list[tuple[np.ndarray, float, dict[str, float]]]:
    """States, times and inputs by chance."""
    rng = np.random.default_rng(4)
    return [
        (state(made, rng), float(rng.uniform(0, 2)), made.random_inputs(rng)) for _ in range(count)
    ]


@pytest.mark.every(6)
@pytest.mark.parametrize("case", TRIED, ids=lambda case: case.name)
def test_kinetic_energy_grows_by_the_power_of_effects(case: Case) -> None:
    """dT/dt = Σ power, with the powers that the module itself gives in doubles."""
    made = light(case.text())
    moved = 0.0
    for y, t, u in moments(made, 2):
        powers = made.exactly("effect_powers", exact(y), u, t=t)
        gained = growth(made, "kinetic_energy", y, t, u=u)
        energy = made.exactly("kinetic_energy", exact(y), u, t=t)
        assert apart(gained, np.sum(powers), powers, energy) < EXACT
        reported = made.module.effect_powers(t, y, u=u)
        assert apart(reported, powers, energy) < 1e-11
        moved = max(moved, float(np.max(np.abs(powers), initial=0)))
    idle = any(words in case.table for words in IDLE)
    assert moved < EXACT if idle else moved > 1e-3


@pytest.mark.every(6)
@pytest.mark.parametrize("case", TRIED, ids=lambda case: case.name)
def test_potential_energy_is_given_back(case: Case) -> None:
    """-dU/dt is the power of an effect that loses nothing, and U is 0 of one that stores nothing;
    so T + U grows by what is not stored.
    """
    made, stored = light(case.text()), 0.0
    p = dict(case.conserves or {})
    assert set(p) <= set(made.module.PARAMETERS)
    for y, t, u in moments(made, 3):
        energy = made.exactly("potential_energy", exact(y), u, p, t=t)
        if case.conserves is None:
            assert energy == 0
            continue
        stored = max(stored, abs(float(energy)))
        lost = growth(made, "potential_energy", y, t, u=u, p=p)
        powers = made.exactly("effect_powers", exact(y), u, p, t=t)
        assert apart(-lost, np.sum(powers), powers, energy) < EXACT
    assert (stored > 1e-3) == (case.conserves is not None)


@pytest.mark.every(6)
@pytest.mark.parametrize("case", TRIED, ids=lambda case: case.name)
def test_jacobians_are_those_of_differences(case: Case) -> None:
    """By state, inputs and parameters; in space along directions, as large scenes have them, and in
    the plane by `ldl`.
    """
    route, space = ("aba", True) if case.base == "space" else ("ldl", False)
    made = engine(case.text(), route, leave_out=OTHERS, tangents=space)
    y, t, u = moments(made, 1)[0]
    for name in ("jacobian", *["input_jacobian"] * bool(u), "parameter_jacobian"):
        found = getattr(made.module, name)(t, y, u=u)
        assert apart(found, slopes(made, name, y, u, t=t)) < 1e-11, name
