"""Actuators of a compiled model: an input each, and effects with forces by formulas."""

from typing import Any

from eomgen.scene.importers.mjcf.compiled import Compiled
from eomgen.scene.importers.mjcf.mechanism import SINGLE, Mechanism, Names
from eomgen.scene.importers.mjcf.poses import cleaned, matrix_of
from eomgen.scene.importers.mjcf.tendons import (
    add_motors,
    is_fixed,
    length_and_rate,
    tendon_factors,
)
from eomgen.scene.importers.rotations import image

UNBOUNDED, NO_ACTUATION = 1 << 8, 1 << 11
"""MuJoCo's disable flags (mjtDisableBit) of bounds of controls, and of actuators."""
ON_JOINT, IN_PARENT, ON_TENDON, ON_SITE = 0, 1, 3, 4
"""MuJoCo's transmissions (mjtTrn) that have a counterpart."""
AT_ONCE, INTEGRATOR, FILTER, FILTER_EXACT = range(4)
"""MuJoCo's activations (mjtDyn): none, and those with one state that obeys a linear equation."""
FIXED, AFFINE = 0, 1
"""MuJoCo's gains (mjtGain), and biases (mjtBias) of none and affine."""
TINY = 1e-15
"""Least time of a filter, s, as in MuJoCo."""


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
    along = length_and_rate(name, arms, made) if _depends(model, a) else ("0", "0")
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
        add_motors(f"{name}_drive", f"{name}_force", arms, made)
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
