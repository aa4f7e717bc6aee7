"""Tendons of a compiled model: sums of coordinates, and springs between two sites."""

from collections.abc import Mapping
from typing import Any

from eomgen.scene.importers.mjcf.compiled import Compiled
from eomgen.scene.importers.mjcf.forces import NO_DAMPER, NO_SPRING
from eomgen.scene.importers.mjcf.mechanism import Mechanism, Names

FIXED = 0
"""MuJoCo's kind of tendon that is a sum of coordinates."""
SITE = 3
"""MuJoCo's kind of point on a tendon (mjtWrap) that is a site."""


def tendon_factors(model: Compiled, t: int) -> dict[int, float]:
    """The factors of coordinates in the length of a fixed tendon, by joint."""
    first, found = model["tendon_adr"][t], dict[int, float]()
    for w in range(first, first + model["tendon_num"][t]):
        joint = model["wrap_objid"][w]
        found[joint] = found.get(joint, 0.0) + model["wrap_prm"][w]
    return found


def is_fixed(model: Compiled, t: int) -> bool:
    """Whether a tendon's length is a sum of coordinates."""
    return bool(model["tendon_type"][t] == FIXED)


def add_tendon(model: Compiled, t: int, names: Names, made: Mechanism, off: int) -> None:
    """The spring and damper of a tendon; what else it has is counted as left out."""
    if model["tendon_armature"][t]:
        made.lost["inertias (armature) of tendons, which would add to the mass matrix"] += 1
    if model["tendon_limited"][t]:
        made.lost["limits of tendons"] += 1
    if model["tendon_frictionloss"][t]:
        made.lost["friction of tendons"] += 1
    stiffness = 0.0 if off & NO_SPRING else model["tendon_stiffness"][t]
    damping = 0.0 if off & NO_DAMPER else model["tendon_damping"][t]
    more = (*model["tendon_stiffnesspoly"][t], *model["tendon_dampingpoly"][t])
    if not is_fixed(model, t):
        if (stiffness or damping or any(more)) and not _add_elastic(model, t, names, made, off):
            made.lost["springs and dampers of tendons in space"] += 1
        return
    if any(more):
        made.lost["springs and dampers of tendons that are not linear"] += 1
    actuator = model["tendon_actuatorid"][t]
    if actuator >= 0 and any(
        model[key][actuator] for key in ("actuator_armature", "actuator_damping")
    ):
        made.lost["inertias and dampings of actuators on tendons"] += 1
    if not (stiffness or damping):
        return
    factors = {names.joints[j]: factor for j, factor in tendon_factors(model, t).items()}
    length, rate = length_and_rate(names.tendons[t], factors, made)
    low, high = model["tendon_lengthspring"][t]
    stretch = f"({length}) - {low!r}"
    if low != high:
        stretch = f"max({length} - {high!r}, 0) + min({length} - {low!r}, 0)"
    name = f"{names.tendons[t]}_tension"
    made.definitions[name] = f"{-stiffness!r}*({stretch}) - {damping!r}*({rate})"
    add_motors(f"{names.tendons[t]}_tendon", name, factors, made)


def _add_elastic(model: Compiled, t: int, names: Names, made: Mechanism, off: int) -> bool:
    """The spring of a tendon between two sites, if it is one: linear, about one length."""
    first, (low, high) = model["tendon_adr"][t], model["tendon_lengthspring"][t]
    more = (*model["tendon_stiffnesspoly"][t], *model["tendon_dampingpoly"][t])
    wraps = range(first, first + model["tendon_num"][t])
    if len(wraps) != 2 or any(model["wrap_type"][w] != SITE for w in wraps):
        return False
    if low != high or any(more) or model["tendon_actuatorid"][t] >= 0:
        return False
    one, other = (model["wrap_objid"][w] for w in wraps)
    ends = [model["site_bodyid"][site] for site in (one, other)]
    if ends[0] == ends[1]:
        return True
    table: dict[str, Any] = {"type": "spring", "name": f"{names.tendons[t]}_elastic"}
    for n, (site, body) in enumerate(zip((one, other), ends, strict=True), 1):
        table |= {f"body_{n}": names.bodies[body], f"at_{n}": list(model["site_pos"][site])}
    table["rest_length"] = low
    if not off & NO_SPRING:
        table["stiffness"] = model["tendon_stiffness"][t]
    if not off & NO_DAMPER:
        table["damping"] = model["tendon_damping"][t]
    made.effects.append(table)
    return True


def length_and_rate(name: str, arms: Mapping[str, float], made: Mechanism) -> tuple[str, str]:
    """The length of an actuator or tendon as a formula, and its rate."""
    rates = {f"{joint}_dot": arm for joint, arm in arms.items()}
    return made.sum(f"{name}_length", arms), made.sum(f"{name}_rate", rates)


def add_motors(name: str, force: str, arms: Mapping[str, float], made: Mechanism) -> None:
    """A motor at each joint, whose torque or force is a multiple of a named one."""
    for joint, arm in arms.items():
        own = name if len(arms) == 1 else f"{name}_{joint}"
        torque = force if arm == 1.0 else f"{arm!r}*{force}"
        made.effects.append({"type": "motor", "name": own, "joint": joint, "torque": torque})
