"""Gravity, springs, dampers, friction and actuators of a compiled model as effects."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from eomgen.scene.importers.mjcf.compiled import Compiled
from eomgen.scene.importers.mjcf.mechanism import BALL, FREE, SINGLE, Mechanism, Names
from eomgen.scene.importers.mjcf.poses import cleaned, matrix_of
from eomgen.scene.importers.rotations import image

SLIDING_SPEED = "friction_speed"
"""The parameter of the speed at which Coulomb friction is smoothed, rad/s or m/s."""
NO_FRICTION, NO_SPRING, NO_DAMPER, NO_GRAVITY, UNBOUNDED, NO_ACTUATION = (
    1 << n for n in (2, 5, 6, 7, 8, 11)
)
"""MuJoCo's disable flags (mjtDisableBit) of what is imported."""
ON_JOINT, IN_PARENT, ON_TENDON = 0, 1, 3
"""MuJoCo's transmissions (mjtTrn) along coordinates."""
AT_ONCE, INTEGRATOR, FILTER, FILTER_EXACT = range(4)
"""MuJoCo's activations (mjtDyn): none, and those with one state that obeys a linear equation."""
FIXED, AFFINE = 0, 1
"""MuJoCo's gains (mjtGain), and biases (mjtBias) of none and affine."""
FIXED_TENDON = 0
SITE = 3
"""MuJoCo's kind of point on a tendon (mjtWrap) that is a site."""
ON_SITE = 4
TINY = 1e-15
"""Least time of a filter, s, as in MuJoCo."""
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
    """Springs, dampers and friction of joints and of fixed tendons."""
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
    for t in range(model["ntendon"]):
        _add_tendon(model, t, names, made, off)


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


def tendon_factors(model: Compiled, t: int) -> dict[int, float]:
    """The factors of coordinates in the length of a fixed tendon, by joint."""
    first, found = model["tendon_adr"][t], dict[int, float]()
    for w in range(first, first + model["tendon_num"][t]):
        joint = model["wrap_objid"][w]
        found[joint] = found.get(joint, 0.0) + model["wrap_prm"][w]
    return found


def is_fixed(model: Compiled, t: int) -> bool:
    """Whether a tendon's length is a sum of coordinates."""
    return bool(model["tendon_type"][t] == FIXED_TENDON)


def _add_tendon(model: Compiled, t: int, names: Names, made: Mechanism, off: int) -> None:
    """Spring and damper of a fixed tendon, and remarks on what else tendons have."""
    if any(model["tendon_armature"][t : t + 1]):
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
    length, rate = _length_and_rate(names.tendons[t], factors, made)
    low, high = model["tendon_lengthspring"][t]
    stretch = f"({length}) - {low!r}"
    if low != high:
        stretch = f"max({length} - {high!r}, 0) + min({length} - {low!r}, 0)"
    name = f"{names.tendons[t]}_tension"
    made.definitions[name] = f"{-stiffness!r}*({stretch}) - {damping!r}*({rate})"
    _add_motors(f"{names.tendons[t]}_tendon", name, factors, made)


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
    table: dict[str, Any] = {"type": "spring", "name": f"{names.tendons[t]}_spring"}
    for n, (site, body) in enumerate(zip((one, other), ends, strict=True), 1):
        table |= {f"body_{n}": names.bodies[body], f"at_{n}": list(model["site_pos"][site])}
    table["rest_length"] = low
    if not off & NO_SPRING:
        table["stiffness"] = model["tendon_stiffness"][t]
    if not off & NO_DAMPER:
        table["damping"] = model["tendon_damping"][t]
    made.effects.append(table)
    return True


def add_actuators(model: Compiled, names: Names, made: Mechanism, off: int) -> None:
    """Actuators along coordinates: an input each, and the torque of its control."""
    for a in range(model["nactuator"]):
        if off & NO_ACTUATION:
            made.lost["actuators, which the file disables"] += 1
            continue
        why = _unsupported(model, a)
        if why:
            made.lost[f"actuators {why}"] += 1
            continue
        _add_actuator(model, a, names, made)


def _unsupported(model: Compiled, a: int) -> str:
    """Why an actuator has no counterpart; "" if it has one."""
    kind, of = model["actuator_trntype"][a], model["actuator_trnid"][a][0]
    if kind in (ON_JOINT, IN_PARENT):
        if model["jnt_type"][of] not in SINGLE:
            return "on ball and free joints"
    elif kind == ON_SITE:
        if model["actuator_trnid"][a][1] >= 0:
            return "between sites"
    elif kind != ON_TENDON or not is_fixed(model, of):
        return "on bodies and tendons in space"
    activation = model["actuator_dyntype"][a]
    if activation not in (AT_ONCE, INTEGRATOR, FILTER, FILTER_EXACT):
        return "with states of muscles, motors or controllers"
    if activation and (kind == ON_SITE or model["actuator_actearly"][a]):
        return "on sites with states, or with states that act early"
    gain, bias = model["actuator_gaintype"][a], model["actuator_biastype"][a]
    if gain not in (FIXED, AFFINE) or bias not in (0, AFFINE) or model["actuator_plugin"][a] >= 0:
        return "whose force is not affine in control, length and velocity"
    if model["actuator_delay"][a] or model["actuator_ctrlnum"][a] != 1:
        return "with a delay, or with several controls"
    if model["opt_disableactuator"] >> model["actuator_group"][a] & 1:
        return "of a group that the file disables"
    return ""


def _add_actuator(model: Compiled, a: int, names: Names, made: Mechanism) -> None:
    """gain control + bias, each affine in length and velocity, times the moment arm."""
    of = model["actuator_trnid"][a][0]
    kind, gears = model["actuator_trntype"][a], model["actuator_gear"][model["actuator_outadr"][a]]
    if kind == ON_SITE:
        arms = {}
    elif kind == ON_TENDON:
        arms = {names.joints[j]: gears[0] * x for j, x in tendon_factors(model, of).items()}
    else:
        arms = {names.joints[of]: gears[0]}
    name = names.inputs[a]
    made.inputs.append({"name": name, "about": "control of an actuator"})
    control, at = name, model["actuator_ctrladr"][a]
    if model["actuator_ctrllimited"][at] and not model["opt_disableflags"] & UNBOUNDED:
        low, high = model["actuator_ctrlrange"][at]
        control = f"max({low!r}, min({high!r}, {control}))"
    states = _states(model, a, name, control)
    control = next(iter(states), control)
    if states and model["actuator_actlimited"][a]:
        made.lost["bounds of states of actuators"] += 1
    along = _length_and_rate(name, arms, made) if _depends(model, a) else ("0", "0")
    gain = _affine(model["actuator_gainprm"][a], model["actuator_gaintype"][a] == AFFINE, along)
    force = control if gain == "1.0" else f"({gain})*{control}"
    if model["actuator_biastype"][a] == AFFINE:
        bias = _affine(model["actuator_biasprm"][a], True, along)
        force = force if bias == "0.0" else f"{force} + {bias}"
    if model["actuator_forcelimited"][a]:
        low, high = model["actuator_forcerange"][a]
        force = f"max({low!r}, min({high!r}, {force}))"
    made.definitions[f"{name}_force"] = force
    if states:
        torques = {joint: f"{arm!r}*{name}_force" for joint, arm in arms.items()}
        table = {"type": "controller", "name": f"{name}_drive", "states": states}
        made.effects.append(table | {"torques": torques})
    else:
        _add_motors(f"{name}_drive", f"{name}_force", arms, made)
    if kind == ON_SITE:
        _add_thrust(model, of, f"{name}_drive", f"{name}_force", gears, names, made)


def _states(model: Compiled, a: int, name: str, control: str) -> dict[str, Any]:
    """The state of an actuator's activation, by name, with its rate; none without one."""
    activation, time = model["actuator_dyntype"][a], model["actuator_dynprm"][a][0]
    if activation == AT_ONCE:
        return {}
    state = f"{name}_activation"
    rate = control if activation == INTEGRATOR else f"({control} - {state})/{max(time, TINY)!r}"
    return {state: {"rate": rate, "about": f"activation of actuator {name}"}}


def _add_thrust(
    model: Compiled,
    site: int,
    name: str,
    force: str,
    gears: list[float],
    names: Names,
    made: Mechanism,
) -> None:
    """A force and a torque at a site, in its axes: multiples of a named force."""
    axes, body = matrix_of(model["site_quat"][site]), model["site_bodyid"][site]
    for kind, part in (("force", gears[:3]), ("torque", gears[3:])):
        if any(part) and body:
            table: dict[str, Any] = {"type": f"external_{kind}", "name": f"{name}_{kind}"}
            table |= {"axes": "body", "body": names.bodies[body]}
            if kind == "force":
                table["at"] = list(model["site_pos"][site])
            vector = [f"{x!r}*{force}" if x else 0.0 for x in cleaned(image(axes, part))]
            made.effects.append(table | {kind: vector})


def _length_and_rate(name: str, arms: Mapping[str, float], made: Mechanism) -> tuple[str, str]:
    """The length of an actuator or tendon as a formula, and its rate."""
    rates = {f"{joint}_dot": arm for joint, arm in arms.items()}
    return made.sum(f"{name}_length", arms), made.sum(f"{name}_rate", rates)


def _depends(model: Compiled, a: int) -> bool:
    """Whether the force of an actuator depends on its length or rate."""
    return any(
        model[f"actuator_{part}type"][a] == AFFINE and any(model[f"actuator_{part}prm"][a][1:3])
        for part in ("gain", "bias")
    )


def _affine(numbers: list[float], moving: bool, along: tuple[str, str]) -> str:
    """a + b length + c rate of an actuator; a alone unless it is `moving`."""
    a, *others = numbers[:3]
    terms = [f"{x!r}*({of})" for x, of in zip(others, along, strict=True) if x and moving]
    return " + ".join([*([repr(a)] if a or not terms else []), *terms])


def _add_motors(name: str, force: str, arms: Mapping[str, float], made: Mechanism) -> None:
    """A motor at each joint, whose torque or force is a multiple of a named one."""
    for joint, arm in arms.items():
        own = name if len(arms) == 1 else f"{name}_{joint}"
        torque = force if arm == 1.0 else f"{arm!r}*{force}"
        made.effects.append({"type": "motor", "name": own, "joint": joint, "torque": torque})
