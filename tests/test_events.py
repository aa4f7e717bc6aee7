"""Runs with rigid contacts against closed forms: impacts, rest, sliding, lifting, works."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from eomgen.errors import RunError
from eomgen.run.complementarity import _lemke, complementary
from eomgen.run.contacts import TOLERANCE
from eomgen.run.integrate import integrate
from eomgen.run.integrators import INTEGRATORS, FixedStep
from eomgen.run.problem import Contacts, Problem
from eomgen.run.works import Powers

G = 9.81
FIXED = [name for name, method in INTEGRATORS.items() if isinstance(method, FixedStep)]
EXACT = {"rtol": 1e-12, "atol": 1e-14}


def mechanism(
    q,
    v,
    normals,
    offsets=None,
    *,
    mass=1.0,
    force=lambda t, q, v: 0.0 * q,
    bounce=1.0,
    slips=None,
    friction=0.0,
    slip_speed=1e-4,
    ground=lambda t: (0.0, 0.0, 0.0),
    names=None,
):
    """M q'' = force, with gaps N q + offsets - ground(t), friction along `slips` q."""
    n = len(q)
    mass = np.broadcast_to(np.asarray(mass, float), (n,))
    normals = np.atleast_2d(np.asarray(normals, float))
    nc = len(normals)
    offsets = np.zeros(nc) if offsets is None else np.asarray(offsets, float)
    slips = np.zeros((nc, n)) if slips is None else np.atleast_2d(np.asarray(slips, float))

    def acceleration(t, y):
        return (force(t, y[:n], y[n:]).T / mass).T

    def derivative(t, y):
        return np.concatenate([y[n:], acceleration(t, y)])

    def jacobian(t, y):
        steps = 1e-6 * np.eye(2 * n)
        columns = [derivative(t, y + h) - derivative(t, y - h) for h in steps]
        return np.array(columns).T / 2e-6

    def impact(t, y, k, factor):
        row = normals[k] / mass
        u = normals[k] @ y[n:] - ground(t)[1]
        return np.append(y[:n], y[n:] - (1 + factor * bounce) * u / (normals[k] @ row) * row)

    def held(t, y, forces):
        v = y[n:]
        slip = slips @ v
        rub = friction * forces * slip / np.sqrt(slip**2 + slip_speed**2)
        vd = acceleration(t, y) + ((normals.T @ forces - slips.T @ rub).T / mass).T
        powers = forces * (normals @ v) - rub * slip
        return np.concatenate([v, vd, normals @ vd - ground(t)[2], powers])

    return Problem(
        name="test",
        states=tuple(f"q{i}" for i in range(n)) + tuple(f"v{i}" for i in range(n)),
        positions=tuple(range(n)),
        derivative=derivative,
        jacobian=jacobian,
        initial=np.array([*q, *v], dtype=float),
        contacts=Contacts(
            names=names or tuple(f"touch_{k}" for k in range(nc)),
            effects=("ground",) * nc,
            gaps=lambda t, y: normals @ y[:n] + offsets - ground(t)[0],
            rates=lambda t, y: normals @ y[n:] - ground(t)[1],
            impact=impact,
            held=held,
        ),
    )


def weight(t, q, v):
    return -G + 0 * q


def ball(height, bounce, v=0.0):
    return mechanism([height], [v], [[1.0]], force=weight, bounce=bounce, names=("ground_ball",))


def run(problem, integrator, t_end, dt=0.01, **options):
    step = {"dt": dt} if integrator in FIXED else {}
    trajectory = integrate(problem, integrator, t_end, **step, **options)
    assert trajectory.finished, trajectory.message
    return trajectory


def times(trajectory, kind="impact"):
    return [event.t for event in trajectory.events if event.kind == kind]


def test_debug():
    for name in INTEGRATORS:
        t = run(ball(1.0, 0.5), name, 3.0)
        print(name, t.counts, len(t.events), t.events[:2], t.events[-1], t.y[-1])


def test_more():
    # cradle
    for e, n in ((1.0, 1), (1.0, 2), (0.0, 1)):
        q = [0.0, 1, 2, 3, 4]
        q = [x - (0.5 if i < n else 0) for i, x in enumerate(q)]
        v = [1.0] * n + [0.0] * (5 - n)
        N = np.zeros((4, 5))
        for i in range(4):
            N[i, i + 1], N[i, i] = 1, -1
        for name in ("DOP853", "rk4", "LSODA"):
            t = run(mechanism(q, v, N, [-1] * 4, bounce=e), name, 2.0)
            print(name, t.y[-1, 5:], t.counts, [(ev.contact, ev.kind) for ev in t.events])
    # hump
    # table
    table = lambda t: (0.1 * np.sin(12 * t), 1.2 * np.cos(12 * t), -14.4 * np.sin(12 * t))
    lift = math.asin(G / 14.4) / 12
    for name in INTEGRATORS:
        p = mechanism([0.0], [1.2], [[1.0]], force=weight, ground=table, bounce=0.3)
        t = run(p, name, 1.0, dt=1e-3)
        print(
            name,
            [e for e in t.events if e.kind == "lift"][0].t - lift,
            t.counts,
            len(t.events),
            t.y[-1],
        )
        print(t.events[:6])


def test_bounce():
    e = 0.5
    t = run(ball(1.0, e), "DOP853", 3.0, **EXACT)
    fall = math.sqrt(2 / G)
    k = np.arange(t.counts["impacts"])
    exact = fall * (1 + 2 * e * (1 - e**k) / (1 - e))
    print(np.array(times(t)) - exact, t.counts, t.events[-1])
