"""Gravity, springs, dampers and friction of joints of a compiled model as effects."""

import math
from collections.abc import Iterator
from typing import Any

from eomgen.scene.importers.mjcf.compiled import Compiled
from eomgen.scene.importers.mjcf.mechanism import BALL, FREE, SINGLE, Mechanism, Names
from eomgen.scene.importers.parts import SLIDING_SPEED

NO_FRICTION, NO_SPRING, NO_DAMPER, NO_GRAVITY = (1 << n for n in (2, 5, 6, 7))
"""MuJoCo's disable flags (mjtDisableBit) of what is imported."""
IDENTITY = [1.0, 0.0, 0.0, 0.0]


def add_gravity(model: Compiled, names: Names, made: Mechanism, off: int) -> None:
    """Gravity, and the forces that MuJoCo's gravity compensation adds."""
    weight = model["opt_gravity"]
    g = math.hypot(*weight)
    if not g or off & NO_GRAVITY:
        return
    table: dict[str, Any] = {"type": "gravity", "g": g}
    if weight[:2] != [0.0, 0.0] or weight[2] > 0:
        table["direction"] = weight
    made.effects.append(table)
    for k in range(1, model["nbody"]):
        share = model["body_gravcomp"][k] * model["body_mass"][k]
        if share:
            name = f"{names.bodies[k]}_compensation"
            table = {"type": "external_force", "name": name, "body": names.bodies[k]}
            made.effects.append(table | {"force": [-share * part for part in weight]})


def add_passive(model: Compiled, names: Names, made: Mechanism, off: int) -> None:
    """Springs, dampers and friction of joints."""
    for j, kind in enumerate(model["jnt_type"]):
        parts = [names.joints[j]]
        if kind == FREE:
            if j not in names.split:
                continue
            parts.insert(0, f"{names.joints[j]}_slide")
        for part in parts:
            slides = len(parts) == 2 and part == parts[0]
            made.effects += _spring(model, j, part, made, off, slides=slides)
            friction = model["dof_frictionloss"][model["jnt_dofadr"][j]]
            if friction and not off & NO_FRICTION:
                table = {"type": "joint_friction", "name": f"{part}_friction", "joint": part}
                made.effects.append(table | {"coulomb": friction, "speed": SLIDING_SPEED})


def _spring(
    model: Compiled, j: int, joint: str, made: Mechanism, off: int, *, slides: bool
) -> Iterator[dict[str, Any]]:
    """The spring and damper of a joint, if it has one."""
    kind, q = model["jnt_type"][j], model["jnt_qposadr"][j]
    stiffness = 0.0 if off & NO_SPRING else model["jnt_stiffness"][j]
    more = [0.0, 0.0] if off & NO_SPRING else model["jnt_stiffnesspoly"][j]
    damping, faster = _damping(model, j, off)
    table: dict[str, Any] = {"type": "joint_spring", "name": f"{joint}_spring", "joint": joint}
    if kind in SINGLE:
        rest = model["qpos_spring"][q]
        if any((*more, *faster)):
            law = _polynomial("stretch", "stretch", (stiffness, *more))
            law += " + " + _polynomial("rate", "abs(rate)", (0.0, *faster))
            table |= {"law": law, "damping": damping, "rest": rest}
            yield table
            return
        if rest and stiffness:
            table["rest"] = rest
    elif kind == BALL and model["qpos_spring"][q : q + 4] != IDENTITY and stiffness:
        made.lost["springs of ball joints with a rest that is no rotation by 0"] += 1
        stiffness = 0.0
    elif kind == FREE and stiffness:
        made.lost["springs of free joints"] += slides
        stiffness = 0.0
    if kind not in SINGLE and any((*more, *faster)):
        made.lost["springs and dampers of ball and free joints that are not linear"] += 1
    if min(stiffness, damping) < 0:
        table["allow_active"] = True
    if stiffness:
        table["stiffness"] = stiffness
    if damping:
        table["damping"] = damping
    if stiffness or damping:
        yield table


def _damping(model: Compiled, j: int, off: int) -> tuple[float, list[float]]:
    """The damping of a joint, with that of an actuator by the square of its gear, and the factors
    of higher powers.
    """
    dof, actuator = model["jnt_dofadr"][j], model["jnt_actuatorid"][j]
    if off & NO_DAMPER:
        return 0.0, [0.0, 0.0]
    damping, faster = model["dof_damping"][dof], list(model["dof_dampingpoly"][dof])
    if actuator >= 0:
        gear = abs(model["actuator_gear"][model["actuator_outadr"][actuator]][0])
        damping += gear**2 * model["actuator_damping"][actuator]
        for n, factor in enumerate(model["actuator_dampingpoly"][actuator]):
            faster[n] += gear ** (n + 3) * factor
    return damping, faster


def _polynomial(name: str, base: str, factors: tuple[float, ...]) -> str:
    """name (a + b base + c base²) with factors a, b, c."""
    terms = [f"{factor!r}*{base}**{n}" for n, factor in enumerate(factors) if factor and n]
    return f"{name}*({' + '.join([repr(factors[0]), *terms])})"
