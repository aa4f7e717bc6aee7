"""Equality constraints of a compiled model as loop joints and couplings.

MuJoCo's are soft: violations decay as of a damped spring. Those of a scene are exact.
"""

from collections.abc import Sequence
from typing import Any

from eomgen.scene.importers.mjcf.compiled import Compiled
from eomgen.scene.importers.mjcf.mechanism import SINGLE, Mechanism, Names
from eomgen.scene.importers.mjcf.poses import angles, inverse, product
from eomgen.scene.importers.mjcf.tendons import is_fixed, tendon_factors

CONNECT, WELD, JOINT, TENDON = 0, 1, 2, 3
"""MuJoCo's kinds of equality (mjtEq) that have a counterpart."""
SITE = 6
"""MuJoCo's object type (mjtObj) of a site."""
NO_EQUALITY, NO_CONSTRAINT = 1 << 1, 1
Pose = tuple[int, Sequence[float], Sequence[float]]
"""A body, a point and a quaternion, in its axes."""


def add_equalities(model: Compiled, names: Names, made: Mechanism, off: int) -> None:
    """The equality constraints that are active at the start."""
    for e, kind in enumerate(model["eq_type"]):
        if off & (NO_EQUALITY | NO_CONSTRAINT) or not model["eq_active0"][e]:
            made.lost["equality constraints that are not active"] += 1
        elif kind == JOINT:
            _add_coupling(model, e, names, made)
        elif kind == TENDON and _are_fixed(model, e):
            _add_equation(model, e, names, made)
        elif kind in (CONNECT, WELD):
            table = _loop(model, e, names)
            if table["parent"] == table["child"]:
                made.lost["equality constraints of a body with itself"] += 1
            else:
                made.joints.append(table)
        else:
            made.lost["equality constraints of tendons in space, flexible bodies or distances"] += 1
    if made.constraints or any(joint.get("loop") for joint in made.joints) or made.locked:
        made.remark("equality constraints are exact here, and soft in MuJoCo")


def _loop(model: Compiled, e: int, names: Names) -> dict[str, Any]:
    """A ball joint or a weld that closes a loop."""
    kind, data = model["eq_type"][e], model["eq_data"][e]
    first, second = _poses(model, e, kind, data)
    parent, child = (names.bodies[body] for body, _, _ in (first, second))
    table: dict[str, Any] = {
        "name": names.equalities[e],
        "type": "ball" if kind == CONNECT else "weld",
        "parent": parent,
        "child": child,
        "loop": True,
        "r_parent": list(first[1]),
        "r_child": list(second[1]),
    }
    if kind == WELD:
        turned = angles(product(first[2], inverse(second[2])))
        if any(turned):
            table["orientation"] = list(turned)
    return table


def _poses(model: Compiled, e: int, kind: int, data: Sequence[float]) -> tuple[Pose, Pose]:
    """The two poses that coincide: of sites, or of bodies as in `eq_data`."""
    ends = (model["eq_obj1id"][e], model["eq_obj2id"][e])
    if model["eq_objtype"][e] == SITE:
        one, other = (
            (model["site_bodyid"][s], model["site_pos"][s], model["site_quat"][s]) for s in ends
        )
        return one, other
    unit = (1.0, 0.0, 0.0, 0.0)
    if kind == CONNECT:
        return (ends[0], data[:3], unit), (ends[1], data[3:6], unit)
    return (ends[0], data[3:6], data[6:10]), (ends[1], data[:3], unit)


def _add_coupling(model: Compiled, e: int, names: Names, made: Mechanism) -> None:
    """y - y0 = a + b d + c d² + …, d = x - x0; a constant if there is no second joint."""
    j, other = model["eq_obj1id"][e], model["eq_obj2id"][e]
    if any(model["jnt_type"][k] not in SINGLE for k in (j, other) if k >= 0):
        made.lost["equality constraints of ball and free joints"] += 1
        return
    start = model["qpos0"][model["jnt_qposadr"][j]]
    numbers = list(model["eq_data"][e][:5])
    name = names.joints[j]
    if other < 0 or not any(numbers[1:]):
        made.locked[name] = start + numbers[0]
        made.start.pop(name, None)
        return
    x, rest = names.joints[other], model["qpos0"][model["jnt_qposadr"][other]]
    equals = _polynomial(f"({x} - {rest!r})" if rest else x, [start + numbers[0], *numbers[1:]])
    table = {"type": "coupling", "name": names.equalities[e], "coordinate": name}
    made.constraints.append(table | {"equals": equals})


def _polynomial(base: str, factors: Sequence[float]) -> str:
    """a + b base + c base² + … with factors a, b, c."""
    first, *others = factors
    powers = [base if n == 1 else f"{base}**{n}" for n in range(1, len(factors))]
    terms = [f"{factor!r}*{power}" for factor, power in zip(others, powers, strict=True) if factor]
    return " + ".join([*([repr(first)] if first or not terms else []), *terms])


def _are_fixed(model: Compiled, e: int) -> bool:
    """Whether the tendons of an equality constraint are sums of coordinates."""
    ends = (model["eq_obj1id"][e], model["eq_obj2id"][e])
    return all(is_fixed(model, t) for t in ends if t >= 0)


def _add_equation(model: Compiled, e: int, names: Names, made: Mechanism) -> None:
    """L - L0 = a + b d + c d² + …, d = M - M0 of the lengths L and M of tendons."""
    t, other = model["eq_obj1id"][e], model["eq_obj2id"][e]
    length = _stretch(model, t, names, made)
    numbers = list(model["eq_data"][e][: 5 if other >= 0 else 1])
    other_length = f"({_stretch(model, other, names, made)})" if other >= 0 else ""
    equals = _polynomial(other_length, numbers)
    made.constraints.append(
        {
            "type": "equation",
            "name": names.equalities[e],
            "position": length if equals == "0.0" else f"{length} - ({equals})",
        }
    )


def _stretch(model: Compiled, t: int, names: Names, made: Mechanism) -> str:
    """The length of a tendon minus that at the start."""
    factors = {names.joints[j]: x for j, x in tendon_factors(model, t).items()}
    text = made.sum(f"{names.tendons[t]}_stretch", factors)
    rest = model["tendon_length0"][t]
    return f"{text} - {rest!r}" if rest else text
