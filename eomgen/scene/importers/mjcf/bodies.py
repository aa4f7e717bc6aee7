"""Bodies and joints of a compiled model as those of a scene.

A body is in its own axes, as in MuJoCo. Between two joints of a body there is a massless body. A
free joint is one of the scene, whose coordinates are those of the centre of mass; where something
acts along its coordinates, it becomes a particle joint and a ball joint at the body's own origin,
whose velocities are MuJoCo's.
"""

from collections.abc import Iterator, Sequence
from typing import Any

from eomgen.scene.importers.mjcf.compiled import Compiled
from eomgen.scene.importers.mjcf.mechanism import (
    BALL,
    FREE,
    HINGE,
    SINGLE,
    SLIDE,
    Mechanism,
    Names,
)
from eomgen.scene.importers.mjcf.poses import about, angles, cleaned, matrix_of, product
from eomgen.scene.importers.mjcf.shapes import shapes_of
from eomgen.scene.importers.rotations import image, rotated_inertia

UNIT = (1.0, 0.0, 0.0, 0.0)
ACTING = ("dof_armature", "dof_damping", "dof_frictionloss")


def joints_of(model: Compiled, body: int) -> range:
    """The numbers of a body's joints."""
    count = model["body_jntnum"][body]
    first = model["body_jntadr"][body]
    return range(first, first + count)


def is_split(model: Compiled, joint: int) -> bool:
    """Whether something acts along the coordinates of a free joint."""
    if model["jnt_type"][joint] != FREE:
        return False
    first = model["jnt_dofadr"][joint]
    acting = any(model[key][first + i] for key in ACTING for i in range(6))
    return acting or bool(model["jnt_stiffness"][joint])


def add_bodies(model: Compiled, names: Names, made: Mechanism) -> None:
    """The bodies of a model, each with its joints."""
    for k in range(1, model["nbody"]):
        found = list(_joints(model, k, names, made))
        made.bodies += [massless(between["child"]) for between in found[:-1]]
        made.bodies.append(_body(model, k, names, made))
        made.joints += found


def massless(name: str) -> dict[str, Any]:
    """A body without mass, which is a frame between two joints."""
    zeros = [0.0, 0.0, 0.0]
    return {"name": name, "mass": 0.0, "inertia_com": zeros, "com": zeros}


def _body(model: Compiled, k: int, names: Names, made: Mechanism) -> dict[str, Any]:
    axes = matrix_of(model["body_iquat"][k])
    entries = cleaned(rotated_inertia([*model["body_inertia"][k], 0.0, 0.0, 0.0], axes))
    mass = model["body_mass"][k]
    table: dict[str, Any] = {
        "name": names.bodies[k],
        "mass": mass,
        "inertia_com": entries if mass else [0.0, 0.0, 0.0],
        "com": list(model["body_ipos"][k]),
    }
    if not mass and any(model["body_inertia"][k]):
        made.lost["inertias of bodies without mass"] += 1
    a, b, c = sorted(model["body_inertia"][k])
    if c > a + b:
        table["inertia_check"] = "off"
    if shapes := shapes_of(model, k, made):
        table["shapes"] = shapes
    return table


def _joints(model: Compiled, k: int, names: Names, made: Mechanism) -> Iterator[dict[str, Any]]:
    """The joints of a body, from its parent outwards."""
    numbers = joints_of(model, k)
    parent = names.bodies[model["body_parentid"][k]]
    pos, quat = model["body_pos"][k], model["body_quat"][k]
    if not numbers:
        weld = {"name": f"{names.bodies[k]}_weld", "type": "weld", "parent": parent}
        yield _placed(weld | {"child": names.bodies[k]}, pos, quat)
        return
    if model["jnt_type"][numbers[0]] == FREE:
        yield from _free(model, k, numbers[0], names, made)
        return
    for j in numbers:
        child = names.bodies[k] if j == numbers[-1] else names.between[k, j]
        table = {"name": names.joints[j], "parent": parent, "child": child}
        yield _single_or_ball(model, j, table, pos, quat, made)
        parent, pos, quat = child, (0.0, 0.0, 0.0), UNIT


def _single_or_ball(
    model: Compiled,
    j: int,
    table: dict[str, Any],
    pos: Sequence[float],
    quat: Sequence[float],
    made: Mechanism,
) -> dict[str, Any]:
    """A hinge, slide or ball; `pos` and `quat` are the pose of its child's axes on the parent."""
    kind, at = model["jnt_type"][j], model["jnt_pos"][j]
    name, rest = table["name"], model["qpos0"][model["jnt_qposadr"][j]]
    table["type"] = {BALL: "ball", SLIDE: "prismatic", HINGE: "revolute"}[kind]
    arm = list(at)
    if kind in SINGLE:
        axis = cleaned(model["jnt_axis"][j])
        table |= {"axis": axis, "coordinate": name}
        # MuJoCo's body is as in the file at qpos0, a scene's at 0.
        if kind == HINGE and rest:
            pin = image(matrix_of(quat), at)
            pos = [p + r for p, r in zip(pos, pin, strict=True)]
            quat = product(quat, about(model["jnt_axis"][j], -rest))
            pin = image(matrix_of(quat), at)
            pos = [p - r for p, r in zip(pos, pin, strict=True)]
        elif rest:
            arm = [r - rest * a for r, a in zip(at, model["jnt_axis"][j], strict=True)]
        if rest:
            made.start[name] = rest
        if model["jnt_limited"][j]:
            table["limits"] = list(model["jnt_range"][j])
    pin = image(matrix_of(quat), arm)
    _placed(table, [p + r for p, r in zip(pos, pin, strict=True)], quat)
    if any(at):
        table["r_child"] = list(at)
    if armature := armature_of(model, j):
        table["motor_inertia"] = armature
    return table


def armature_of(model: Compiled, j: int) -> float:
    """The inertia that rotors add to the velocities of a joint: its own, and that of an actuator
    with the square of its gear, as MuJoCo adds it.
    """
    found: float = model["dof_armature"][model["jnt_dofadr"][j]]
    actuator = model["jnt_actuatorid"][j]
    if actuator >= 0:
        gear = model["actuator_gear"][model["actuator_outadr"][actuator]][0]
        found += gear**2 * model["actuator_armature"][actuator]
    return found


def _placed(table: dict[str, Any], pos: Sequence[float], quat: Sequence[float]) -> dict[str, Any]:
    if any(pos):
        table["r_parent"] = list(pos)
    turned = angles(quat)
    if any(turned):
        table["orientation"] = list(turned)
    return table


def _free(
    model: Compiled, k: int, j: int, names: Names, made: Mechanism
) -> Iterator[dict[str, Any]]:
    """A free joint, or a particle and a ball joint at the body's origin."""
    body, first = names.bodies[k], model["jnt_qposadr"][j]
    pos, quat = model["qpos0"][first : first + 3], model["qpos0"][first + 3 : first + 7]
    if j not in names.split:
        yield {"name": names.joints[j], "type": "free", "child": body}
        arm = image(matrix_of(quat), model["body_ipos"][k])
        pos, prefix, point = [p + r for p, r in zip(pos, arm, strict=True)], body, body
    else:
        point, prefix = names.between[k, j], names.joints[j]
        slide: dict[str, Any] = {"name": f"{prefix}_slide", "type": "particle"}
        slide |= {"parent": "world", "child": point}
        turn: dict[str, Any] = {"name": prefix, "type": "ball", "parent": point, "child": body}
        if armature := model["dof_armature"][model["jnt_dofadr"][j]]:
            slide["motor_inertia"] = turn["motor_inertia"] = armature
        yield slide
        yield turn
    made.start |= {f"{point}_{x}": p for x, p in zip("xyz", pos, strict=True) if p}
    if any(quat[1:]):
        made.start |= {f"{prefix}_q{x}": p for x, p in zip("wxyz", quat, strict=True) if p}
