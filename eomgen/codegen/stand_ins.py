"""Effects as symbols of the closed form.

A derivation writes out what depends on parameters, inputs and joints alone. Of every other effect
it sees where its loads act; their components are symbols to it, which stand for nodes of the tape.
An effect without loads, such as a rigid contact, leaves nothing.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from eomgen.codegen.recording import Recording
from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.tree.vectors import add, cross, in_space, torque_in_space, zeros
from eomgen.language.formula import ZERO, Name
from eomgen.language.quantity import Parameter
from eomgen.model.dependence import is_plain
from eomgen.model.model import Model
from eomgen.program.tape import Node, Stage
from eomgen.scalars.protocol import Scalars
from eomgen.scene.effects import Effect
from eomgen.scene.effects.base import EffectTable, Input, JointLoad, Load, Mechanism, Vector
from eomgen.scene.joints.base import WORLD

MOST_POINTS = 2
"""The most points of a body at which an effect has symbols of its own; the loads at more are one
force at the centre of mass and one torque.
"""

AnyLoad = Load | JointLoad


class StandIn(EffectTable):
    """The loads of another effect, whose components are inputs and whose points are parameters. A
    symbol is given by its name, 0 by "".
    """

    type: Literal["stand-in"] = "stand-in"
    components: Any

    def loads(self, mechanism: Mechanism) -> Iterator[AnyLoad]:
        """The loads, over the symbols."""

        def given(name: str) -> Any:
            return mechanism.input(name) if name else mechanism.zero

        for load in self.components:
            if isinstance(load, JointLoad):
                yield replace(load, force=given(load.force))
            else:
                force, torque = (tuple(map(given, x)) for x in (load.force, load.torque))
                yield replace(load, force=force, torque=torque, at=_fixed(load.at, mechanism))


class Fall(EffectTable):
    """Uniform gravity in any direction, by the components of its acceleration. In a free tree its
    terms cancel, so they are written out.
    """

    type: Literal["fall"] = "fall"
    components: Any

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """The weight of each body, at its centre of mass."""
        zeros = (mechanism.zero,) * mechanism.dimensions
        for body in mechanism.bodies:
            m = mechanism.value(mechanism.masses[body])
            force = tuple(m * part for part in _fixed(self.components, mechanism))
            yield Load(body, force, zeros, "gravity")


def _fixed(names: Sequence[str], mechanism: Mechanism) -> Vector:
    return tuple(mechanism.value(Name(name) if name else ZERO) for name in names)


@dataclass
class _Names:
    """The symbols made so far, and the nodes that they stand for."""

    scalars: Scalars
    inputs: dict[str, Node] = field(default_factory=dict)
    parameters: dict[str, Node] = field(default_factory=dict)

    def named(self, load: AnyLoad) -> AnyLoad:
        """A load with the names of symbols as its components; "" for one that is 0."""
        if isinstance(load, JointLoad):
            return replace(load, force=self._input(load.force))
        force, torque = (tuple(map(self._input, x)) for x in (load.force, load.torque))
        return replace(load, force=force, torque=torque, at=self.fixed(load.at), in_body=None)

    def fixed(self, vector: Vector) -> tuple[str, ...]:
        """The names of symbols for a vector that depends on parameters alone."""
        return tuple(self._of(part, self.parameters, "fixed") for part in vector)

    def _input(self, node: Node) -> str:
        return self._of(node, self.inputs, "load")

    def _of(self, node: Node, known: dict[str, Node], word: str) -> str:
        if self.scalars.is_zero(node):
            return ""
        name = f"{word}__{len(known) + 1}"
        known[name] = node
        return name


def with_stand_ins(
    model: Model, dynamics: Dynamics | None = None
) -> tuple[Model, Mapping[str, Node]]:
    """The model as a derivation takes it, without extra states and with a stand-in for each effect
    that it does not write out; and the nodes that the stand-ins' symbols stand for, on the tape of
    `dynamics`, by default one of their own. The model itself if it needs none.
    """
    if all(is_plain(effect, model) for effect in model.effects):
        return model, {}
    d = dynamics or Recording(model, "aba").dynamics
    names = _Names(d.scalars)
    effects = list[Any]()
    for effect in model.effects:
        if is_plain(effect, model):
            effects.append(effect)
        elif effect.uniform:
            effects.append(Fall(name=effect.name, components=names.fixed(effect.acceleration(d))))
        elif loads := [names.named(load) for load in _loads(effect, d)]:
            effects.append(StandIn(name=effect.name, components=loads))
    inputs = (*model.inputs, *(Input(name, "", "") for name in names.inputs))
    parameters = (*model.parameters, *(Parameter(name, 1.0, "", "") for name in names.parameters))
    derived = replace(model, effects=tuple(effects), inputs=inputs, parameters=parameters, extra=())
    return derived, names.inputs | names.parameters


def _loads(effect: Effect, d: Dynamics) -> list[AnyLoad]:
    """The loads of an effect on joints and bodies, few on each body, at fixed points."""
    loads = [x for x in effect.loads(d) if isinstance(x, JointLoad) or x.body != WORLD]
    found: list[AnyLoad] = [x for x in loads if isinstance(x, JointLoad)]
    for body in d.bodies:
        own = [x for x in loads if isinstance(x, Load) and x.body == body]
        still = all(x.step.stage <= Stage.PARAMETERS for load in own for x in load.at)
        found += own if still and len(own) <= MOST_POINTS else [_at_centre(own, d)]
    return found


def _at_centre(loads: Sequence[Load], d: Dynamics) -> Load:
    """Loads on one body as one force at its centre of mass and one torque, in world axes."""
    s, n = d.scalars, d.dimensions
    force, torque = zeros(s), zeros(s)
    for load in loads:
        push, arm = (in_space(x, s) for x in (load.force, d.outward(load.body, load.at)))
        force = add(force, push)
        torque = add(torque, add(torque_in_space(load.torque, s), cross(arm, push)))
    turn = torque if n == 3 else torque[2:]
    return Load(loads[0].body, force[:n], zeros(s)[:n], loads[0].kind, turn)
