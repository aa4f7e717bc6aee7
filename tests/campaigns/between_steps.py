"""Is anything between steps overlooked by `--accuracy`, called met although rounding decides, or
without an end?

    python tests/campaigns/between_steps.py [--count N] [--first I] [--seed S] [--limit SECONDS]

Random scenes: pulses in time from 1 µs, bumps and wells in a field, bullets that meet a hard ball
for a moment, pendulums up to 1e-12 rad from upright, relays with and without a sliding mode, light
bodies on stiff springs. The end of each run is compared with a closed form, or with SciPy's DOP853
on pieces that begin and end where something does. It prints a line for each scene, and how many
were met and wrong, or took longer than the limit.
"""

import argparse
import math
import signal
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import mpmath
import numpy as np
from scipy.integrate import solve_ivp

import eomgen
from eomgen.study.accuracy.measure import scales

TARGETS = (1e-3, 1e-6, 1e-9)
UNITS = {"x": "m", "y": "m", "x_dot": "m/s", "y_dot": "m/s", "q": "rad", "q_dot": "rad/s"}
MASS, ARM, INERTIA, G = 1.2, 0.35, 0.04, 9.81
WEIGHT, WHOLE = MASS * G * ARM, INERTIA + MASS * ARM**2
PENDULUM = """name = "pendulum"
bodies = [{{ name = "a", mass = 1.2, inertia_com = 0.04 }}]
joints = [{{ name = "p", type = "revolute", parent = "world", child = "a", r_child = [-0.35, 0] }}]
effects = [{{ type = "gravity", g = 9.81 }}{more}]
initial = {{ q = [{q!r}], v = [{v!r}] }}
simulation = {{ t_end = {end!r} }}
"""
SLIDER = """name = "slider"
bodies = [{{ name = "m", mass = 1.0, inertia_com = 0 }}]
effects = [{effect}]
initial = {{ q = [{q!r}], v = [{v!r}] }}
simulation = {{ t_end = {end!r} }}
[[joints]]
name = "s"
type = "prismatic"
parent = "world"
child = "m"
axis = [1, 0]
coordinate = "x"
"""
BULLET = """name = "bullet"
bodies = [{{ name = "b", mass = 1.0, inertia_com = 0 }}]
joints = [
  {{ name = "f", type = "particle", parent = "world", child = "b", coordinates = ["x", "y"] }},
]
initial = {{ q = [0.0, {aside!r}], v = [{v!r}, 0.0] }}
simulation = {{ t_end = {end!r} }}
[[effects]]
name = "o"
type = "contact"
law = "spring_damper"
body = "b"
radius = 0.0
against = "ball"
other_at = [{c!r}, 0.0]
other_radius = {r!r}
stiffness = {k!r}
"""

Drawn = tuple[str, Callable[[], Sequence[float]] | None]
"""A scene, and its last state; None if it has none: a sliding mode."""


def solved(
    f: Callable[[float, Any], Any],
    y: Sequence[float],
    marks: Sequence[float],
    most: Sequence[float],
) -> Any:
    """The state at the last of some times; between two of them steps are at most so long."""
    for (a, b), longest in zip(pairwise(marks), most, strict=False):
        run = solve_ivp(f, (a, b), y, "DOP853", rtol=3e-14, atol=1e-15, max_step=longest)
        y = run.y[:, -1]
    return y


def motor(torque: str) -> str:
    return f', {{ type = "motor", name = "m", joint = "p", torque = "{torque}" }}'


def pulse(rng: Any) -> Drawn:
    """A pendulum that is pushed for a moment."""
    w, c, area = 10 ** rng.uniform(-6, -2), rng.uniform(2, 8), rng.uniform(0.05, 0.4)
    q, a = rng.uniform(-2.5, -1.2), area / w
    shape = rng.choice(["bell", "steps", "tanh", "hill"])
    x = lambda t: (t - c) / w  # noqa: E731
    forms: dict[str, tuple[str, Callable[[float], float]]] = {
        "bell": (f"{a!r}*exp(-((t - {c!r})/{w!r})**2)", lambda t: math.exp(-(x(t) ** 2))),
        "steps": (f"{a!r}*(step(t - {c!r}) - step(t - {c + w!r}))", lambda t: 1.0),
        "tanh": (
            f"{a!r}*(tanh((t - {c!r})/{w!r}) - tanh((t - {c + 4 * w!r})/{w!r}))/2",
            lambda t: (math.tanh(x(t)) - math.tanh(x(t) - 4)) / 2,
        ),
        "hill": (f"{a!r}/(1 + ((t - {c!r})/{w!r})**4)", lambda t: 1 / (1 + x(t) ** 4)),
    }
    text, height = forms[str(shape)]

    def end() -> Any:
        def free(t: float, y: Any) -> Any:
            return [y[1], -WEIGHT * math.cos(y[0]) / WHOLE]

        def pushed(t: float, y: Any) -> Any:
            return [y[1], (-WEIGHT * math.cos(y[0]) + a * height(t)) / WHOLE]

        if shape == "steps":
            y = solved(free, [q, 0.0], (0, c), (1,))
            y = solved(pushed, y, (c, c + w), (w / 4,))
            return solved(free, y, (c + w, 10), (1,))
        # Pieces whose lengths grow with the distance from the pulse, ten or more steps in each.
        sides = [s * w * 4.0**k for k in range(40) for s in (-1, 1)]
        marks = sorted({0.0, 10.0, *(c + side for side in sides if 0 < c + side < 10)})
        longest = [(b - a) / 10 for a, b in pairwise(marks)]
        return solved(pushed, [q, 0.0], marks, longest)

    return PENDULUM.format(more=motor(text), q=q, v=0.0, end=10.0), end


def bump(rng: Any) -> Drawn:
    """A body that slides over a narrow hill or well."""
    w, c, v = 10 ** rng.uniform(-6, -2), rng.uniform(1, 4), rng.uniform(1, 5)
    a = rng.uniform(-0.2, 0.2) * v * v / w  # too low to turn it back
    forms: dict[str, tuple[str, Callable[[float], float]]] = {
        "bell": (f"exp(-((x - {c!r})/{w!r})**2)", lambda s: math.exp(-s * s)),
        "sech": (f"(1 - tanh((x - {c!r})/{w!r})**2)", lambda s: 1 - math.tanh(s) ** 2),
        "hill": (f"1/(1 + ((x - {c!r})/{w!r})**4)", lambda s: 1 / (1 + s**4)),
    }
    text, height = forms[str(rng.choice(list(forms)))]
    scene = SLIDER.format(
        effect=f'{{ type = "motor", name = "m", joint = "s", torque = "{a!r}*{text}" }}',
        q=0.0,
        v=v,
        end=8.0 / v,
    )

    def end() -> Any:
        # v dv = F dx, dt = dx/v: in x, until the time has passed.
        def f(s: float, z: Any) -> Any:  # s = (x - c)/w
            return [a * w * height(s) / z[0], w / z[0]]

        reach = 1e4
        marks = [-reach, -100.0, -10.0, 10.0, 100.0, reach]
        start = (c - reach * w) if reach * w < c else 0.0
        marks[0] = (start - c) / w
        marks = [m for m in marks if m >= marks[0]]
        z = solved(f, [v, start / v], marks, [1e3, 3.0, 0.25, 3.0, 1e3])
        return [c + reach * w + z[0] * (8.0 / v - z[1]), z[0]]

    return scene, end


def bullet(rng: Any) -> Drawn:
    """A point that meets a hard ball on its way, in the middle or aside."""
    v, r, c = 10 ** rng.uniform(1, 3), 10 ** rng.uniform(-3, -1), rng.uniform(20, 120)
    k = 10 ** rng.uniform(0.5, 2.5) * (v / r) ** 2
    aside = 0.0 if rng.random() < 0.3 else rng.uniform(0, 0.99) * r
    t_end = float(f"{rng.uniform(1.2, 2.0) * c / v:.6g}")
    scene = BULLET.format(c=c, r=r, k=k, aside=aside, v=v, end=t_end)

    def end() -> Any:
        t = (c - math.sqrt(r * r - aside * aside)) / v
        first = [-math.sqrt(r * r - aside * aside), aside, v, 0.0]  # from the ball's centre

        def f(t: float, y: Any) -> Any:
            d = math.hypot(y[0], y[1])
            return [y[2], y[3], k * (r - d) * y[0] / d, k * (r - d) * y[1] / d]

        def out(t: float, y: Any) -> float:
            return math.hypot(y[0], y[1]) - r if t > 0 else -1.0

        out.terminal, out.direction = True, 1  # type: ignore[attr-defined]
        rates = {"rtol": 3e-14, "atol": 1e-14 * v, "max_step": 0.02 / math.sqrt(k)}
        run = solve_ivp(f, (0, 10 * r / v), first, "DOP853", events=out, **rates)
        y, left = run.y[:, -1], t_end - t - run.t[-1]
        return [c + y[0] + y[2] * left, y[1] + y[3] * left, y[2], y[3]]

    return scene, end


def separatrix(rng: Any) -> Drawn:
    """A pendulum that falls from almost upright, once or more often."""
    q = math.pi / 2 + 10 ** rng.uniform(-12, -6)
    t_end = float(f"{rng.uniform(3, 16):.6g}")

    def end() -> Any:
        with mpmath.workdps(60):
            mass, arm, inertia, g = map(mpmath.mpf, (MASS, ARM, INERTIA, G))
            rate = mpmath.sqrt(mass * g * arm / (inertia + mass * arm**2))
            # From the lowest position, where it is at rest at pi + below = q + pi/2 beyond.
            start = mpmath.mpf(q) + mpmath.pi / 2 - 2 * mpmath.pi
            k = mpmath.sin(start / 2)
            m, u = k * k, rate * mpmath.mpf(t_end)
            place = k * mpmath.ellipfun("cd", u, m=m)
            angle = 2 * mpmath.asin(place)
            fast = -k * (1 - m) * mpmath.ellipfun("sd", u, m=m) * mpmath.ellipfun("nd", u, m=m)
            speed = 2 * rate * fast / mpmath.sqrt(1 - place * place)
            return [float(angle - mpmath.pi / 2 + 2 * mpmath.pi), float(speed)]

    return PENDULUM.format(more="", q=q, v=0.0, end=t_end), end


def relay(rng: Any) -> Drawn:
    """A force that switches: back and forth, or into a sliding mode."""
    a, x, lead = rng.uniform(1, 5), rng.uniform(0.3, 2), rng.choice([0.0, 0.0, 0.5])
    text = "x" if not lead else f"x + {lead}*x_dot"
    force = f"{-a!r} if {text} > 0 else {a!r}"
    scene = SLIDER.format(
        effect=f'{{ type = "motor", name = "u", joint = "s", torque = "{force}" }}',
        q=x,
        v=0.0,
        end=7.0,
    )
    quarter = math.sqrt(2 * x / a)

    def end() -> Any:
        turns, s = divmod(7.0, 2 * quarter)
        sign = -1.0 if turns % 2 else 1.0
        # From rest at sign x to rest at -sign x: falls to 0, then is slowed down.
        left = s if s <= quarter else 2 * quarter - s
        at = (x - a * left**2 / 2) * (1 if s <= quarter else -1)
        return [sign * at, -sign * a * left]

    return scene, None if lead else end


def spring(rng: Any) -> Drawn:
    """A light body on a stiff spring."""
    k, ratio, x = (
        10 ** rng.uniform(6, 11),
        10 ** rng.uniform(-4, 0.3),
        0.3 + 10 ** rng.uniform(-9, -3),
    )
    turns = 10 ** rng.uniform(1, 3.3)
    rate, rest = math.sqrt(k), 0.3
    decay = ratio * rate
    t_end = float(f"{turns / rate:.6g}")
    given = f"stiffness = {k!r}, damping = {2 * decay!r}, rest = {rest!r}"
    effect = f'{{ type = "joint_spring", name = "k", joint = "s", {given} }}'
    scene = SLIDER.format(effect=effect, q=x, v=0.0, end=t_end)

    def end() -> Any:
        with mpmath.workdps(40):
            own, d = mpmath.mpf(k), mpmath.mpf(2 * decay) / 2
            root = mpmath.sqrt(mpmath.mpc(d * d - own))
            one, two, t = -d + root, -d - root, mpmath.mpf(t_end)
            far = mpmath.mpf(x) - mpmath.mpf(rest)
            c = far * two / (two - one)
            e = far - c
            place = c * mpmath.exp(one * t) + e * mpmath.exp(two * t)
            speed = c * one * mpmath.exp(one * t) + e * two * mpmath.exp(two * t)
            return [float(rest + place.real), float(speed.real)]

    return scene, end


KINDS = (pulse, bump, bullet, separatrix, relay, spring)


class LateError(Exception):
    """A run took longer than allowed."""


def late(*_: object) -> None:
    raise LateError


def main() -> None:
    """Make the runs and print what came of them."""
    given = argparse.ArgumentParser()
    for name, value in (("count", 60), ("first", 0), ("seed", 0), ("limit", 120)):
        given.add_argument(f"--{name}", type=int, default=value)
    options = given.parse_args()
    signal.signal(signal.SIGALRM, late)
    wrong = endless = met = 0
    for i in range(options.first, options.count):
        rng = np.random.default_rng([options.seed, i])
        kind, target = KINDS[i % len(KINDS)], TARGETS[(i // len(KINDS)) % len(TARGETS)]
        scene, end = kind(rng)
        began = time.monotonic()
        signal.alarm(options.limit)
        try:
            run = eomgen.simulate(scene, accuracy=target)
        except LateError:
            endless += 1
            print(f"{i} {kind.__name__} {target:g}: WITHOUT AN END\n{scene}", flush=True)
            continue
        finally:
            signal.alarm(0)
        seconds, choice = time.monotonic() - began, run.choice
        assert choice is not None
        off = math.nan
        if end is not None and run.trajectory.finished:
            y = run.trajectory.y
            scale = scales(run.trajectory.states, UNITS, y)
            off = float(np.max(np.abs(y[-1] - np.array(end())) / scale))
        bad = choice.met and not off <= target
        wrong, met = wrong + bad, met + choice.met
        said = "MET AND WRONG" if bad else "met" if choice.met else "not met"
        print(
            f"{i} {kind.__name__} {target:g}: {said}, error {off:.2g}, "
            f"estimate {choice.error:.2g}, {run.options}, {choice.runs} runs, {seconds:.1f} s"
            + (f"\n{scene}" if bad else ""),
            flush=True,
        )
    count = options.count - options.first
    print(f"{count} scenes: {met} met, {wrong} met and wrong, {endless} without an end")


if __name__ == "__main__":
    main()
