"""The commands `schema`, `reference` and `check`."""

import shlex
import sys

from eomgen.api.given import checked
from eomgen.commands.assembling import draw_assembly, print_assembly
from eomgen.commands.identifying import print_identifiable
from eomgen.commands.shared import (
    FEW,
    Arguments,
    overlap_lines,
    print_listed,
    print_wrapped,
    read_whole,
    reporter_of,
    shortened,
)
from eomgen.language.formula import written
from eomgen.model.bodies import Body
from eomgen.model.model import Model
from eomgen.scene.joints.base import WORLD, Geared


def print_schema(given: Arguments) -> int:
    """Print the JSON Schema of the scene language."""
    from eomgen.scene.json_schema import json_schema

    print(json_schema(), end="")
    return 0


def print_reference(given: Arguments) -> int:
    """Print the keys of joints and effects, in Markdown."""
    from eomgen.scene.reference import reference

    print(reference(given.type), end="")
    return 0


def check(given: Arguments) -> int:
    """Validate a scene; print its bodies, joints, degrees of freedom, limits and effects."""
    scene, model, _ = read_whole(given.scene, given)
    reporter = reporter_of(given, given.scene)
    checked(model, reporter)
    most = sys.maxsize if given.long else FEW
    print(f"{model.name}: {model.title}")
    print(f"dimensions  {model.dimensions}: {'the plane' if model.dimensions == 2 else 'space'}")
    print_listed("bodies      ", shortened([body.name for body in model.bodies], most))
    for line in shortened([_joint(model, body) for body in model.bodies], most):
        print_wrapped("joint       ", line)
    print(f"freedom     {model.freedom}")
    for c in model.prescribed:
        label = "locked      " if c.locked else "driven      "
        print_wrapped(label, f"{c.position.name} = {written(c.value)} {c.position.unit}")
    for words in model.leave_out:
        print(f"left out    {words.replace('_', ' ')}")
    print_listed("points      ", shortened([point.name for point in model.points], most))
    effects = [effect.type for effect in model.effects]
    counted = [
        f"{effects.count(name)} {name}" if effects.count(name) > 1 else name
        for name in dict.fromkeys(effects)
    ]
    print_listed("effects     ", counted)
    if model.constraints:
        print_listed("constraints ", shortened([name for name, _ in model.rows], most))
    for line in shortened(overlap_lines(model), most):
        print_wrapped("at start    ", line)
    inputs = [f"{i.name} = {i.default:g}" if i.default else i.name for i in model.inputs]
    print_listed("inputs      ", shortened(inputs, most))
    values = [f"{p.name} = {p.default:g}" for p in model.parameters]
    print_listed("parameters  ", shortened(values, most))
    if max(len(values), len(model.bodies), len(model.points), len(model.inputs)) > most:
        print(f"            eomgen check {shlex.quote(given.scene)} --long lists all")
    if given.identifiable is not None:
        print_identifiable(model, given.identifiable, scene.simulation.t_end, reporter)
    if given.assemble:
        print_assembly(model)
    if given.picture is not None:
        draw_assembly(given.scene, given.picture, force=given.force)
    return 0


def _joint(model: Model, body: Body) -> str:
    """Name, type, bodies, coordinates and limits of the joint between a body and its parent."""
    joint = body.joint
    parent = WORLD if body.parent < 0 else model.bodies[body.parent].name
    names = ", ".join(c.name for c in body.positions) or "holds fast"
    line = f"{joint.name}: {joint.type}, {parent} to {body.name}; {names}"
    if isinstance(joint, Geared) and joint.limits is not None:
        low, high = joint.limits
        line += f" from {low:g} to {high:g} {body.positions[0].unit}"
    return line
