"""Planar linkages with closed formulas, and their scenes; nothing here imports eomgen.

Bars are uniform but for their moments of inertia; angles of the formulas are from the world's x
axis. The reduced equation of motion of one freedom θ is Eksergian's,

    m(θ) θ̈ + m'(θ) θ̇² / 2 + V'(θ) = 0,    kinetic energy m θ̇² / 2
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

G = 9.81
Array = np.ndarray


@dataclass(frozen=True)
class Motion:
    """A linkage at an angle θ of its crank: the coordinates of its scene, their derivatives by θ,
    and θ̈ of the free motion at θ̇.
    """

    q: Array
    by_angle: Array
    twice: Array
    acceleration: float

    def accelerations(self, rate: float) -> Array:
        """Of all coordinates."""
        return np.asarray(self.by_angle * self.acceleration + self.twice * rate**2)


def along(angle: float) -> Array:
    """The unit vector at an angle."""
    return np.array([np.cos(angle), np.sin(angle)])


def across(angle: float) -> Array:
    """Its derivative by the angle."""
    return np.array([-np.sin(angle), np.cos(angle)])


def body(name: str, mass: float, inertia: float) -> str:
    """A body as TOML."""
    return f'[[bodies]]\nname = "{name}"\nmass = {mass!r}\ninertia_com = {inertia!r}\n'


def pin(name: str, parent: str, at: Sequence[float], child: str, own: Sequence[float],
        *, loop: bool = False) -> str:  # fmt: skip
    """A pin as TOML; a joint of the tree has the coordinate `name`."""
    last = "loop = true" if loop else f'coordinate = "{name}"'
    ends = f"r_parent = {[*map(float, at)]}\nr_child = {[*map(float, own)]}"
    return (
        f'[[joints]]\nname = "pin_{name}"\ntype = "revolute"\nparent = "{parent}"\n'
        f'child = "{child}"\n{ends}\n{last}\n'
    )


def head(name: str) -> str:
    """The start of a scene, with gravity."""
    return f'name = "{name}"\ndimensions = 2\n[[effects]]\ntype = "gravity"\ng = {G!r}\n'


# Slider-crank.

CRANK, ROD = 0.2, 0.7
MASSES, INERTIAS = (1.3, 0.8, 2.1), (0.011, 0.035)


def slider_crank_scene(angle: float, rate: float) -> str:
    """A crank at the origin, a rod, and a slider along x."""
    names = ("crank", "rod", "slider")
    bodies = [body(n, m, i) for n, m, i in zip(names, MASSES, (*INERTIAS, 0.01), strict=True)]
    slide = (
        '[[joints]]\nname = "guide"\ntype = "prismatic"\nparent = "world"\nchild = "slider"\n'
        'axis = [1, 0]\ncoordinate = "x"\n'
    )
    joints = [
        pin("theta", "world", (0, 0), "crank", (-CRANK / 2, 0)),
        pin("bend", "crank", (CRANK / 2, 0), "rod", (-ROD / 2, 0)),
        slide,
        pin("wrist", "rod", (ROD / 2, 0), "slider", (0, 0), loop=True),
    ]
    start = f"[initial]\nq = {{ theta = {angle!r} }}\nv = {{ theta_dot = {rate!r} }}\n"
    return "\n".join([head("slider_crank"), *bodies, *joints, start])


def slider_crank(angle: float, rate: float) -> Motion:
    """The closed formulas; coordinates theta, bend, x."""
    r, length, (m1, m2, m3), (i1, i2) = CRANK, ROD, MASSES, INERTIAS
    phi = -np.arcsin(r * np.sin(angle) / length)
    d = -r * np.cos(angle) / (length * np.cos(phi))
    dd = (r * np.sin(angle) / length + np.sin(phi) * d**2) / np.cos(phi)
    x = r * np.cos(angle) + length * np.cos(phi)
    c2 = r * across(angle) + length / 2 * d * across(phi)
    cc2 = -r * along(angle) + length / 2 * (dd * across(phi) - d**2 * along(phi))
    dx = -r * np.sin(angle) - length * np.sin(phi) * d
    ddx = -r * np.cos(angle) - length * (np.sin(phi) * dd + np.cos(phi) * d**2)
    mass = m1 * r**2 / 4 + i1 + m2 * c2 @ c2 + i2 * d**2 + m3 * dx**2
    half_rate = m2 * c2 @ cc2 + i2 * d * dd + m3 * dx * ddx
    slope = G * (m1 * r / 2 * np.cos(angle) + m2 * c2[1])
    found = -(half_rate * rate**2 + slope) / mass
    columns = ([angle, phi - angle, x], [1.0, d - 1.0, dx], [0.0, dd, ddx])
    return Motion(*map(np.array, columns), float(found))


# Four-bar.

BARS, GROUND = (0.25, 0.8, 0.55), 0.75
BAR_MASSES, BAR_INERTIAS = (1.2, 2.2, 1.6), (0.008, 0.11, 0.04)


def four_bar_scene(angle: float, rate: float) -> str:
    """A crank at the origin, a coupler, and a rocker at (GROUND, 0), on the open branch."""
    names = ("crank", "coupler", "rocker")
    bodies = [body(*each) for each in zip(names, BAR_MASSES, BAR_INERTIAS, strict=True)]
    a, b, c = BARS
    joints = [
        pin("theta", "world", (0, 0), "crank", (-a / 2, 0)),
        pin("bend", "crank", (a / 2, 0), "coupler", (-b / 2, 0)),
        pin("gamma", "world", (GROUND, 0), "rocker", (-c / 2, 0)),
        pin("close", "coupler", (b / 2, 0), "rocker", (c / 2, 0), loop=True),
    ]
    _, bend, gamma = four_bar(angle, rate).q.tolist()
    start = f"[initial]\nq = {{ theta = {angle!r} }}\nv = {{ theta_dot = {rate!r} }}\n"
    start += f"guess = {{ bend = {bend!r}, gamma = {gamma!r} }}\n"
    return "\n".join([head("four_bar"), *bodies, *joints, start])


def four_bar(angle: float, rate: float) -> Motion:
    """The closed formulas of the open branch; coordinates theta, bend, gamma."""
    (a, b, c), (m1, m2, m3), (i1, i2, i3) = BARS, BAR_MASSES, BAR_INERTIAS
    x, y = GROUND - a * np.cos(angle), -a * np.sin(angle)
    far = np.hypot(x, y)
    beta = np.arctan2(y, x) + np.arccos((b * b + far * far - c * c) / (2 * b * far))
    gamma = np.arctan2(b * np.sin(beta) - y, b * np.cos(beta) - x)
    opening = np.sin(beta - gamma)
    db = a * np.sin(gamma - angle) / (b * opening)
    dg = a * np.sin(beta - angle) / (c * opening)
    turned = np.cos(beta - gamma)
    ddb = -(a * np.cos(angle - gamma) + b * db**2 * turned - c * dg**2) / (b * opening)
    ddg = (c * dg**2 * turned - a * np.cos(angle - beta) - b * db**2) / (c * opening)
    c2 = a * across(angle) + b / 2 * db * across(beta)
    cc2 = -a * along(angle) + b / 2 * (ddb * across(beta) - db**2 * along(beta))
    of_c = i3 + m3 * c**2 / 4
    mass = i1 + m1 * a**2 / 4 + m2 * c2 @ c2 + i2 * db**2 + of_c * dg**2
    half_rate = m2 * c2 @ cc2 + i2 * db * ddb + of_c * dg * ddg
    slope = m1 * a / 2 * np.cos(angle) + m2 * c2[1] + m3 * c / 2 * np.cos(gamma) * dg
    found = -(half_rate * rate**2 + G * slope) / mass
    columns = ([angle, beta - angle, gamma], [1.0, db - 1.0, dg], [0.0, ddb, ddg])
    return Motion(*map(np.array, columns), float(found))


def four_bars(count: int) -> str:
    """A chain of four-bars: each stands on the coupler of the one before it."""
    tables, (a, b, c) = [head(f"four_bars_{count}")], BARS
    base, feet = "world", ((0.0, 0.0), (GROUND, 0.0))
    q = four_bar(1.0, 0.0).q
    start = []
    for k in range(count):
        names = (f"crank_{k}", f"coupler_{k}", f"rocker_{k}")
        tables += [body(*each) for each in zip(names, BAR_MASSES, BAR_INERTIAS, strict=True)]
        crank, coupler, rocker = names
        tables += [
            pin(f"theta_{k}", base, feet[0], crank, (-a / 2, 0)),
            pin(f"bend_{k}", crank, (a / 2, 0), coupler, (-b / 2, 0)),
            pin(f"gamma_{k}", base, feet[1], rocker, (-c / 2, 0)),
            pin(f"close_{k}", coupler, (b / 2, 0), rocker, (c / 2, 0), loop=True),
        ]
        words = zip(("theta", "bend", "gamma"), q, strict=True)
        start += [f"{name}_{k} = {float(x)!r}" for name, x in words]
        base, feet = coupler, ((-GROUND / 2, 0.1), (GROUND / 2, 0.1))
    return "\n".join([*tables, f"[initial]\nq = {{ {', '.join(start)} }}\n"])


# Peaucellier's cell.

LONG, SIDE, ARM = 0.5, 0.3, 0.15
LINE = (LONG**2 - SIDE**2) / (2 * ARM)
"""Where the pen's line is: at this x, m."""


def peaucellier_scene(angle: float = 0.5, rate: float = 0.0) -> str:
    """Two long arms at the origin with a rhombus, whose near corner a crank at (ARM, 0) leads on a
    circle through the origin; the point `pen` is the far corner.
    """
    near = np.array([ARM, 0.0]) + ARM * along(angle)
    direction, distance = np.arctan2(near[1], near[0]), np.hypot(*near)
    pen = (LONG**2 - SIDE**2) / distance * along(direction)
    open_ = np.arccos((LONG**2 + distance**2 - SIDE**2) / (2 * LONG * distance))
    tables = [head("peaucellier"), body("crank", 0.3, 0.0006)]
    joints = [pin("theta", "world", (ARM, 0), "crank", (-ARM / 2, 0))]
    q = {"theta": angle}
    for name, sign in (("left", 1.0), ("right", -1.0)):
        tables += [body(f"{name}_arm", 1.0, 0.02), body(f"{name}_in", 0.6, 0.005),
                   body(f"{name}_out", 0.6, 0.005)]  # fmt: skip
        joints.append(pin(name, "world", (0, 0), f"{name}_arm", (-LONG / 2, 0)))
        q[name] = direction + sign * open_
        corner = LONG * along(q[name])
        for part, end in (("in", near), ("out", pen)):
            own = f"{name}_{part}"
            joints.append(pin(own, f"{name}_arm", (LONG / 2, 0), own, (-SIDE / 2, 0)))
            q[own] = np.arctan2(*(end - corner)[::-1]) - q[name]
            if part == "in":
                joints.append(pin(f"{own}_end", own, (SIDE / 2, 0), "crank", (ARM / 2, 0),
                                  loop=True))  # fmt: skip
    half = (SIDE / 2, 0)
    joints.append(pin("pen", "left_out", half, "right_out", half, loop=True))
    point = f'[[points]]\nname = "pen"\nbody = "left_out"\nat = [{SIDE / 2}, 0]\n'
    start = ", ".join(f"{name} = {float(x)!r}" for name, x in q.items())
    initial = f"[initial]\nq = {{ {start} }}\n"
    spring = (
        '[[effects]]\ntype = "joint_spring"\nname = "spring"\njoint = "pin_theta"\n'
        "stiffness = 100.0\n"
    )
    return "\n".join([*tables, *joints, spring, point, initial])
