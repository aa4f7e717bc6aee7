"""The program of a page: the interactive model's derivative, and what the page draws and plots."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from eomgen.codegen.choice import choose
from eomgen.codegen.from_recursion import from_recursion
from eomgen.codegen.recording import Recording
from eomgen.codegen.system import System, optimised
from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.tree.loads import generalised
from eomgen.dynamics.tree.vectors import scale, zeros
from eomgen.language.formula import Formula, evaluate
from eomgen.model.interactive import Pull, interactive, switches_of
from eomgen.model.model import Model
from eomgen.program.passes import optimise
from eomgen.program.program import Output, Program, cost, finish, interpreter
from eomgen.program.scalars import TapeScalars
from eomgen.program.tape import TIME, Node, Stage, Tape
from eomgen.scene.effects.base import JointLoad
from eomgen.scene.joints.base import WORLD


@dataclass(frozen=True)
class LiveSystem:
    """The system of an interactive model, with further outputs: `loads`, `geometry` and
    `effect_forces`, which leave the pulls out.

    loads       for each load of an effect the names of the effect and of the body; one on a joint
                is drawn as one on its child
    operations  of one call of `derivative` with all effects on and nothing pulled
    saved       operations that each effect takes, by name
    """

    system: System
    loads: tuple[tuple[str, str], ...]
    operations: int
    saved: Mapping[str, int]


def live_system(model: Model, geometry: Sequence[Formula] = ()) -> LiveSystem:
    """The program of a model's page; `geometry` are formulas of parameters and time."""
    live = interactive(model)
    derived = choose(live, closed=False).derived
    record = Recording(live, derived.route, axes=derived.axes)
    system = from_recursion(record, jacobian=False)
    loads, nodes = _loads(record)
    forces = _forces(record)
    names = {**record.parameters, TIME: record.dynamics.values.time}
    formulas = [evaluate(formula, names, record.scalars) for formula in geometry]
    more = {"loads": record.closed(nodes), "geometry": record.closed(formulas)}
    more |= {"effect_forces": record.closed(forces)}
    outputs = {
        **system.program.outputs,
        **{name: Output((len(part),), tuple(n.index for n in part)) for name, part in more.items()},
    }
    program = finish(record.tape, outputs, system.program.checks)
    system = optimised(replace(system, program=program))
    operations, saved = _operations(model, system.program)
    return LiveSystem(system, loads, operations, saved)


def _loads(record: Recording) -> tuple[tuple[tuple[str, str], ...], list[Node]]:
    """For each load: the point of application, the force and the torque, world axes."""
    d, n = record.dynamics, record.model.dimensions
    found: list[tuple[str, str]] = []
    nodes: list[Node] = []
    for effect in record.model.effects:
        if isinstance(effect, Pull):
            continue
        for load in effect.loads(d):
            if isinstance(load, JointLoad):
                drawn = _at_joint(d, load)
                if drawn:
                    found.append((effect.name, d.joint_indices[load.joint].body.name))
                    nodes += drawn
            elif load.body != WORLD:
                torque = load.torque or (record.scalars.number(0.0),) * (1 if n == 2 else 3)
                found.append((effect.name, load.body))
                nodes += [*d.position(load.body, load.at), *load.force, *torque]
    return tuple(found), nodes


def _at_joint(d: Dynamics, load: JointLoad) -> list[Node]:
    """A load on a joint as one on its child: the joint's place, force and torque, world axes."""
    i = d.joint_indices[load.joint].v[load.coordinate]
    for k, link in enumerate(d.kinematics.links):
        for axis, j in zip(link.axes, link.v, strict=True):
            if i == j:
                along = d.kinematics.to_world(k, scale(load.force, axis.direction))
                force, torque = (zeros(d.scalars), along)[:: 1 if axis.angular else -1]
                n = d.dimensions
                return [*d.origins[k][:n], *force[:n], *(torque if n == 3 else torque[2:])]
    return []


def _forces(record: Recording) -> list[Node]:
    """The generalised forces of each effect of the scene, row by row."""
    d, nv = record.dynamics, len(record.v)
    effects = [effect for effect in record.model.effects if not isinstance(effect, Pull)]
    return [x for effect in effects for x in generalised(d, effect.loads(d))[:nv]]


def _operations(model: Model, program: Program) -> tuple[int, dict[str, int]]:
    """The operations of `derivative` with all effects on, and those that each effect takes.

    Constants in place of switches and pulls fold what does not act.
    """
    switches = switches_of(model)
    live = interactive(model)
    pulls = {i.name: 0.0 for i in live.inputs[len(model.inputs) :]}
    all_on = dict.fromkeys(switches.values(), 1.0)
    whole = pulls | all_on
    count = _count(program, whole)
    return count, {
        name: count - _count(program, whole | {switch: 0.0}) for name, switch in switches.items()
    }


def _count(program: Program, given: Mapping[str, float]) -> int:
    """The operations of `derivative` with constants in place of some inputs."""
    tape = Tape()
    inputs = {
        str(s.value): tape.constant(given[str(s.value)])
        if s.value in given
        else tape.input(str(s.value), Stage(s.stage))
        for s in program.steps
        if s.operation == "input"
    }
    nodes = interpreter(program, "derivative", TapeScalars(tape))(inputs)
    outputs = {"derivative": Output((len(nodes),), tuple(node.index for node in nodes))}
    return cost(optimise(finish(tape, outputs, ())), "derivative")["total"]
