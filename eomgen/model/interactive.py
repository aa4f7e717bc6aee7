"""The interactive model of a page: effects can be switched off, and bodies pulled.

`interactive` adds parameters and inputs to a model. With each switch at 1 and each pull at 0 it is
the same mechanism. Names of scenes contain no double underscore, so none of these collides.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, cast

from eomgen.language.formula import Name
from eomgen.language.quantity import Parameter
from eomgen.model.model import Model
from eomgen.scene.effects import Effect
from eomgen.scene.effects.base import (
    Contact,
    EffectTable,
    ExtraState,
    Input,
    JointLoad,
    Load,
    Mechanism,
    Resistance,
    Sampling,
    Scalar,
    Vector,
)

OUTPUTS = (
    *("kinetic_energy", "potential_energy", "joint_forces", "body_poses", "body_velocities"),
    "velocity_force",
)
"""The outputs of the interactive model."""
OF_LOOPS = ("mass_matrix", "kinetic_slopes", "constraint_forces")
"""Those beside with constraints: for the steps of leapfrog, and in the equations of motion."""
OF_STEPS = ("implicit_step",)
"""Those for the steps of a method that a scene asks for."""


class Switched(EffectTable):
    """Another effect, whose loads and potential energy are multiplied by the parameter `switch`."""

    type: Literal["switched"] = "switched"
    name: str
    effect: Any
    switch: str

    def inputs(self, dimensions: int) -> tuple[Input, ...]:
        """Those of the effect."""
        return cast(tuple[Input, ...], self.effect.inputs(dimensions))

    def states(self, dimensions: int) -> tuple[ExtraState, ...]:
        """Those of the effect."""
        return cast(tuple[ExtraState, ...], self.effect.states(dimensions))

    def rates(self, mechanism: Mechanism) -> tuple[Scalar, ...]:
        """Those of the effect, whether it is switched on or off."""
        return cast(tuple[Scalar, ...], self.effect.rates(mechanism))

    def loads(self, mechanism: Mechanism) -> Iterator[Load | JointLoad]:
        """Those of the effect times the switch."""
        on = mechanism.value(Name(self.switch))
        for load in self.effect.loads(mechanism):
            yield scaled(load, on)

    def sampling(self) -> Sampling | None:
        """That of the effect, whether it is switched on or off."""
        return cast(Sampling | None, self.effect.sampling())

    def samples(self, mechanism: Mechanism, noise: Mapping[str, Scalar]) -> Sequence[Scalar]:
        """Those of the effect."""
        return cast(Sequence[Scalar], self.effect.samples(mechanism, noise))

    def resistances(self, mechanism: Mechanism, h: Scalar) -> Iterator[Resistance]:
        """Those of the effect times the switch."""
        on = mechanism.value(Name(self.switch))
        for each in self.effect.resistances(mechanism, h):
            change = None if each.change is None else on * each.change
            yield Resistance(each.loads, on * each.stiffness, on * each.damping, change)

    def contact_names(self, bodies: Sequence[str]) -> tuple[str, ...]:
        """Those of the effect."""
        return cast(tuple[str, ...], self.effect.contact_names(bodies))

    def contacts(self, mechanism: Mechanism) -> tuple[Contact, ...]:
        """Those of the effect; the page ignores them while it is switched off."""
        return cast(tuple[Contact, ...], self.effect.contacts(mechanism))

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """That of the effect times the switch."""
        return mechanism.value(Name(self.switch)) * self.effect.potential_energy(mechanism)


class Pull(EffectTable):
    """A force at the centre of mass of a body and a torque on it, world axes, all inputs."""

    type: Literal["pull"] = "pull"
    name: str
    body: str

    def inputs(self, dimensions: int) -> tuple[Input, ...]:
        """The components of the force, then those of the torque."""
        force = [
            Input(f"pull__{self.body}_{axis}", "N", f"pull on {self.body}, {axis}")
            for axis in "xyz"[:dimensions]
        ]
        torque = [
            Input(f"turn__{self.body}_{axis}", "N m", f"torque on {self.body}, {axis}")
            for axis in ("xyz" if dimensions == 3 else "z")
        ]
        return (*force, *torque)

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """The force and the torque."""
        given = [mechanism.input(i.name) for i in self.inputs(mechanism.dimensions)]
        n = mechanism.dimensions
        at = (mechanism.zero,) * n
        yield Load(self.body, tuple(given[:n]), at, "applied", tuple(given[n:]))


def interactive(model: Model) -> Model:
    """The model of form [q, v] with a switch for each effect and a wrench on each body. All
    coordinates are states: a pull may lead anywhere.

    Parameters that are switches follow those of the scene: 1 is on, 0 is off. Inputs of the pulls
    follow those of the scene, body by body: force, then torque, in world axes.
    """
    switches = switches_of(model)
    effects = [_switched(effect, switches.get(effect.name)) for effect in model.effects]
    pulls = [Pull(name=f"pull__{body.name}", body=body.name) for body in model.bodies]
    added = tuple(
        Parameter(switch, 1.0, "", f"whether {name} acts, 1 or 0")
        for name, switch in switches.items()
    )
    return replace(
        model,
        parameters=(*model.parameters, *added),
        inputs=(*model.inputs, *(i for pull in pulls for i in pull.inputs(model.dimensions))),
        effects=cast(tuple[Effect, ...], (*effects, *pulls)),
        outputs=(
            *OUTPUTS,
            *(OF_LOOPS if model.constraints else ()),
            *(name for name in OF_STEPS if name in model.outputs),
        ),
        form="velocity",
        route=model.route if model.route != "closed" else "auto",
        loops_kept="projected",
    )


def switches_of(model: Model) -> Mapping[str, str]:
    """The switch of each effect that has one, by the name of the effect. Joints that an effect
    drives have no coordinates of their own, so it has none.
    """
    return {e.name: f"switch__{e.name}" for e in model.effects if not e.prescribes()}


def _switched(effect: Effect, switch: str | None) -> EffectTable:
    """An effect that the parameter `switch` switches; the effect itself for None."""
    if switch is None:
        return effect
    own = effect.switched(Name(switch))
    return own or Switched(name=effect.name, effect=effect, switch=switch)


def scaled(load: Load | JointLoad, factor: Scalar) -> Load | JointLoad:
    """A load times a number."""
    if isinstance(load, JointLoad):
        return replace(load, force=load.force * factor)
    own = load.in_body and (_times(load.in_body[0], factor), _times(load.in_body[1], factor))
    return replace(
        load,
        force=_times(load.force, factor),
        torque=_times(load.torque, factor),
        in_body=own,
    )


def _times(vector: Iterable[Scalar], factor: Scalar) -> Vector:
    return tuple(x * factor for x in vector)
