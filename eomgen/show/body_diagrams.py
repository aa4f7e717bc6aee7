"""Free-body diagrams: each body by itself, every force with its name in the equations."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import sympy as sp

from eomgen.derivation.effects import DerivedEffect
from eomgen.derivation.own_names import names_within
from eomgen.derivation.reading import read
from eomgen.derivation.symbols import OF_SCENE
from eomgen.model.model import Model
from eomgen.scene.effects.base import JointLoad, Load
from eomgen.show.drawing import Arc, Dot, Drawing, Item, Label, Line, Point, moved
from eomgen.show.labels import with_clear_labels
from eomgen.show.sketches import MARGIN, Fit, Pose, Shape, apart, is_held, numbers, skeleton

Expr = Any
PANEL, PANEL_BODY = 230.0, 92.0
"""The side of a free-body diagram, and the size of the body in it."""
FORCE = 38.0
"""Length of a force whose size is not drawn."""
CROWDED = 7
"""From so many loads on a body its diagram is larger, and they are numbered."""
ROW = 15.0
"""Height of a line of the list of numbered loads."""


def body_diagrams(model: Model, effects: Sequence[DerivedEffect]) -> tuple[Drawing, ...]:
    """The free-body diagram of each body: every force with its name in the equations."""
    pose = Pose(model)
    return tuple(with_clear_labels(_diagram(pose, x, effects)) for x in pose.shapes(effects))


def named_loads(
    model: Model, effects: Sequence[DerivedEffect]
) -> Iterator[tuple[str, tuple[Expr, ...]]]:
    """Each body, and the names of the forces and torques in its diagram."""
    pose = Pose(model)
    for shape in pose.shapes(effects):
        items = _diagram(pose, shape, effects).items
        labels = (x.text for x in items if isinstance(x, Label) and x.style == "force")
        yield shape.body.name, tuple(dict.fromkeys(x for x in labels if isinstance(x, sp.Expr)))


def _diagram(pose: Pose, shape: Shape, effects: Sequence[DerivedEffect]) -> Drawing:
    model, body = pose.model, shape.body
    names = names_within(model)
    found = [
        (start, direction, read(label, names), style)
        for derived in effects
        for start, direction, label, style in _loads_on(pose, shape, derived)
    ]
    panel = PANEL if len(found) + len(shape.joints) < CROWDED else 1.45 * PANEL
    room = PANEL_BODY + 2 * MARGIN + 0.6 * (panel - PANEL)
    fit = Fit([*shape.points], room, room)
    shift = (panel - room) / 2

    def at(p: Point) -> Point:
        x, y = fit.at(p)
        return (x + shift, y + shift)

    def joint_force(joint: str) -> Expr:
        return read(sp.Symbol(f"f_{joint}"), names)

    forces: list[tuple[Point, Point, Expr, str]] = []
    torques: dict[Point, dict[Expr, None]] = {}
    for start, direction, label, style in found:
        if direction is None:
            torques.setdefault(at(start), {})[label] = None
        else:
            forces.append((at(start), direction, label, style))
    held = {x.joint.name for x in model.bodies if is_held(model, x)}
    if shape.own is not None and body.joint.name in held:
        name = body.joint.name
        forces.append((at(shape.own), _unknown(name, -1), -joint_force(name), "force"))
    for name, p in ((name, p) for name, p in shape.others if name in held):
        forces.append((at(p), _unknown(name, 1), joint_force(name), "force"))
    items: list[Item] = [*skeleton(shape, at)]
    items.append(Dot(at(shape.centre), 3.2, True))
    items += (Dot(at(p), 4.2, False, "arm") for p in shape.joints)
    busy = [*map(at, shape.joints), *torques]
    named = [label for *_, label, _ in forces]
    named += [label for labels in torques.values() for label in labels]
    numbers: dict[Expr, str] = {}
    if len(named) >= CROWDED:
        numbers = {label: str(i) for i, label in enumerate(dict.fromkeys(named), 1)}
    items += _drawn_forces(forces, busy, panel, numbers)
    for p, labels in torques.items():
        items += _drawn_torques(p, list(labels), numbers)
    items.append(Label((panel / 2, 10), body.name, "axis"))
    depth = ROW * ((len(numbers) + 1) // 2) + 8.0 * bool(numbers)
    items = [moved(item, depth) for item in items]
    items += _legend(numbers, panel, depth)
    title = f"Free-body diagram of {body.name} in {model.title}"
    return Drawing(panel, panel + depth, title, tuple(items))


def _legend(numbers: Mapping[Expr, str], panel: float, depth: float) -> Iterator[Item]:
    """The names of numbered forces, in two columns below a diagram."""
    rows = (len(numbers) + 1) // 2
    for i, (label, shown) in enumerate(numbers.items()):
        column, row = divmod(i, rows)
        x, y = panel * (0.04 + 0.51 * column), depth - ROW * (row + 0.6)
        yield Label((x, y), shown, "force")
        yield Label((x + 12, y), label, "force", start=True)


def _drawn_torques(p: Point, labels: Sequence[Expr], numbers: Mapping[Expr, str]) -> Iterator[Item]:
    """One arc for all torques at a point that turn the same way, with their names below it."""
    below = p[1] - 29.0
    for turning in (1, -1):
        named = [x for x in labels if x.could_extract_minus_sign() == (turning < 0)]
        if named:
            radius = 17.0 if turning > 0 else 22.0
            first = math.radians(200) if turning > 0 else math.radians(-20)
            yield Arc(p, radius, first, first + turning * math.radians(220), "force")
        if named and numbers:
            yield Label((p[0], below), ", ".join(numbers[x] for x in named), "force")
            below -= 13.0
        for label in named if not numbers else ():
            yield Label((p[0], below), label, "force")
            below -= 13.0


def _drawn_forces(
    forces: Sequence[tuple[Point, Point, Expr, str]],
    busy: Sequence[Point],
    panel: float,
    numbers: Mapping[Expr, str],
) -> Iterator[Item]:
    """Arrows with names or numbers. Of those at one point with the same direction the first has it
    and the others fan out, so forces of known direction come first.
    """
    used: list[tuple[Point, float]] = []
    taken = [*busy, *(start for start, *_ in forces)]
    for start, direction, label, style in forces:
        angle = math.atan2(direction[1], direction[0])
        for turn in (0.0, 0.45, -0.45, 0.9, -0.9, 1.4, -1.4, 2.0, -2.0):
            if all(
                apart(p, start) > 6 or abs(math.remainder(a - angle - turn, 2 * math.pi)) > 0.35
                for p, a in used
            ):
                angle += turn
                break
        used.append((start, angle))
        c, s = math.cos(angle), math.sin(angle)
        end = (start[0] + FORCE * c, start[1] + FORCE * s)
        yield Line((start, end), style, arrow=True)
        shown = numbers.get(label, label)
        half = 3.2 * len(str(shown)) + 4
        places = [(end[0] + half * c * 0.9, end[1] + 11 * s)]
        places += [(end[0] + side * half, end[1] + up) for up in (0, 12, -12) for side in (1, -1)]
        places = [
            (min(max(x, half), panel - half), min(max(y, 24.0), panel - 8)) for x, y in places
        ]
        place = max(places, key=lambda p: min(35.0, *(apart(p, q) for q in taken), 1e9))
        taken += [place, end]
        yield Label(place, shown, style)


def _unknown(joint: str, sign: int) -> Point:
    """A direction for a force that is not known yet: opposite on the two bodies, and neither along
    a weight nor along a horizontal force.
    """
    angle = math.radians((35, 60, 130)[sum(map(ord, joint)) % 3])
    return (sign * math.cos(angle), sign * math.sin(angle))


def _loads_on(
    pose: Pose, shape: Shape, derived: DerivedEffect
) -> Iterator[tuple[Point, Point | None, Expr, str]]:
    """Start, direction (None for a torque), name and style of each load of an effect on a body."""
    model, body = pose.model, shape.body
    if derived.falls:
        weight = next(
            (x for x in derived.loads if isinstance(x, Load) and x.body == body.name), None
        )
        if weight is not None and any(weight.force):
            size = next(f for f in weight.force if f != 0)
            down = pose.flat((*(0.0,) * (model.dimensions - 1), -1.0))
            brief = len(size.args) <= 3  # -1, mass, g
            name = sp.Symbol(f"f_{derived.effect.name},{body.name}")
            yield shape.centre, down, -size if brief else name, "force"
        return
    for load in derived.loads:
        if isinstance(load, Load):
            if load.body == body.name:
                yield from _one_load(pose, load, derived)
        elif load.joint == body.joint.name and shape.own is not None:
            yield shape.own, _slide(pose, load), _joint_name(load, derived), "force"
        else:
            for name, p in shape.others:
                if name == load.joint:
                    along = _slide(pose, load)
                    back = None if along is None else (-along[0], -along[1])
                    yield p, back, -_joint_name(load, derived), "force"
    for contact in derived.contacts:
        for side in contact.normal:
            if isinstance(side, Load) and side.body == body.name:
                start = pose.point(body.name, numbers(model, side.at))
                direction = _direction(pose, side.force)
                yield start, direction, sp.Symbol(f"P_{contact.name}"), "impulse"


def _slide(pose: Pose, load: JointLoad) -> Point | None:
    """Where the child goes when the coordinate of a load grows; None if it turns."""
    model = pose.model
    body = next(body for body in model.bodies if body.joint.name == load.joint)
    found = body.joint.primitives(model.dimensions)[load.coordinate :]
    if not found or found[0].kind != "prismatic":  # a ball has three coordinates, one primitive
        return None
    x, y, z = found[0].axis
    if found[-1].kind == "revolute" and not any(found[-1].axis[:2]):  # it turns in its plane after
        angle = float(pose.state.coordinate(load.joint, load.coordinate + len(found) - 1))
        c, s = math.cos(angle), math.sin(angle)
        x, y = c * x + s * y, c * y - s * x
    return pose.flat(pose.state.outward(body.name, (x, y, z)[: model.dimensions]))


def _one_load(
    pose: Pose, load: Load, derived: DerivedEffect
) -> Iterator[tuple[Point, Point | None, Expr, str]]:
    start = pose.point(load.body, numbers(pose.model, load.at))
    if any(load.force):
        name = _vector_name(load.force) or f"f_{derived.effect.name},{load.body}"
        yield start, _direction(pose, load.force), sp.Symbol(name), "force"
    if any(load.torque):
        name = _vector_name(load.torque) or f"t_{derived.effect.name},{load.body}"
        yield start, None, sp.Symbol(name), "force"


def _joint_name(load: JointLoad, derived: DerivedEffect) -> Expr:
    """The name of a load at a joint; the components of a torque at a ball share one."""
    several = [x for x in derived.loads if isinstance(x, JointLoad) and x.joint == load.joint]
    if load.force.is_Symbol and len(several) == 1:
        return load.force
    return sp.Symbol(f"tau_{derived.effect.name},{load.joint}")


def _vector_name(parts: Sequence[Expr]) -> str:
    """The shared name of components that are symbols: f_A of f_A_x and f_A_y."""
    names = [x.name.removesuffix(OF_SCENE) for x in parts if x != 0 and x.is_Symbol]
    if len(names) != sum(part != 0 for part in parts):
        return ""
    if len(parts) == 1:
        return str(names[0])
    stems = {name[:-2] for name in names if name[-2:-1] in ("_", ",")}
    return stems.pop() if len(stems) == 1 else ""


def _direction(pose: Pose, force: Sequence[Expr]) -> Point:
    """The direction of a force at the initial pose if its components are numbers, else upwards."""
    up = (*(0.0,) * (pose.model.dimensions - 1), 1.0)
    known = all(f.is_number for f in force)
    x, y = pose.flat(tuple(float(f) for f in force) if known else up)
    if known or pose.model.dimensions == 3:
        return (x, y)
    horizontal = any(f != 0 for f in force[:1])
    vertical = any(f != 0 for f in force[1:])
    return (
        (0.55 * horizontal, 0.83 * vertical)
        if horizontal and vertical
        else ((1.0, 0.0) if horizontal else (0.0, 1.0))
    )
