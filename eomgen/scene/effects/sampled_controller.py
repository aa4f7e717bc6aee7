"""A controller that samples: it measures, computes and acts at the ticks of a clock."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from eomgen.base.errors import SceneError
from eomgen.language.base import Identifier, Number, Positive, Table, Text
from eomgen.language.formula import ZERO, Constant, is_zero
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import (
    EffectTable,
    ExtraState,
    JointLoad,
    Mechanism,
    Sampling,
    Scalar,
)
from eomgen.scene.effects.elements import AtJoint, Layout

MOST = 100
"""Greatest number of sensors, of states, or of driven inputs of one controller."""
LONGEST = 100
"""Greatest delay in periods."""


class SensorTable(Table):
    """A sensor of a sampled controller: it measures `value`, adds normal noise of the standard
    deviation `noise`, and rounds to a multiple of `quantum`. Its last reading is a state with its
    name, which formulas use.
    """

    value: Quantity = quantity("", "what it measures", sees=("motion",))
    noise: Quantity = quantity("", "standard deviation of its noise", "nonnegative", default=ZERO)
    quantum: Quantity = quantity(
        "", "size of the steps of its readings", "nonnegative", default=ZERO
    )
    unit: Annotated[str, Field(max_length=40, pattern=r"^[A-Za-z0-9 /^*.()-]*$")] = ""
    about: Text = ""

    def reading(self, mechanism: Mechanism, noise: Scalar) -> Scalar:
        """What it reads, with a normal number for its noise."""
        found = mechanism.value(self.value)
        if not is_zero(self.noise):
            found = found + mechanism.value(self.noise) * noise
        if is_zero(self.quantum):
            return found
        return mechanism.rounded(found, mechanism.value(self.quantum))


class DiscreteStateTable(Table):
    """A state z of a sampled controller: it is `initial` before the first sample, and `next` after
    each one.
    """

    initial: Number = 0.0
    next: Quantity = quantity("", "its value after a sample", sees=("motion",))
    unit: Annotated[str, Field(max_length=40, pattern=r"^[A-Za-z0-9 /^*.()-]*$")] = ""
    about: Text = ""


class SampledController(EffectTable):
    """At t = 0, `period`, 2 `period`, … it reads `sensors`, then gives inputs of the scene and
    torques at joints the values of their formulas, and its states those of `next`. Between samples
    all of them are held.

    Formulas use t, coordinates, velocities, parameters, readings of this sample, and states and
    inputs as they were before it; so none depends on itself. Sensors do not use readings of the
    same sample. With `delay` inputs and torques change so many seconds after the sample. Readings,
    states and held values are states of the module. Noise follows from `seed`, which is a
    parameter, the number of the sensor and that of the sample alone, and is the same everywhere.
    """

    example: ClassVar[str] = """
[[effects]]
type = "sampled_controller"
name = "hold"
period = 0.01
sensors = { angle = { value = "elbow_angle", noise = 1e-3, quantum = 1e-3 } }
states = { before = { next = "angle" } }
torques = { elbow = "-5*angle - 40*(angle - before)" }
"""
    told = (
        "At equal times a sample gives its readings, its states, and after its delay the inputs "
        "and torques that it holds new values, marked by +. Between samples they stay as they are. "
        "n is normal noise of variance 1."
    )
    joint_fields = ("torques",)

    type: Literal["sampled_controller"]
    name: Identifier
    period: Positive = Field(description="time from one sample to the next, s")
    delay: Annotated[Number, Field(ge=0)] = Field(
        default=0.0, description="time from a sample to the change of inputs and torques, s"
    )
    sensors: Annotated[dict[Identifier, SensorTable], Field(max_length=MOST)] = Field(
        default={}, description="its sensors by name"
    )
    own_states: Annotated[dict[Identifier, DiscreteStateTable], Field(max_length=MOST)] = Field(
        default={}, alias="states", description="its states by name"
    )
    driven: Annotated[dict[Identifier, Quantity], Field(max_length=MOST)] = quantity(
        "", "input of the scene", sees=("motion",), default={}, alias="inputs"
    )
    torques: Annotated[dict[Identifier, Quantity], Field(max_length=MOST)] = quantity(
        "N m | N", "torque | force", sees=("motion",), default={}
    )
    seed: Quantity = quantity(
        "", "whole number from which noise follows", "nonnegative", default=Constant(1.0)
    )

    def checked(self, dimensions: int, location: str) -> "SampledController":
        """The controller itself. Raises `SceneError` for a delay that is too long."""
        if self.delay > LONGEST * self.period:
            raise SceneError(
                f"{location}.delay: {self.delay:g} s is more than {LONGEST} periods of "
                f"{self.period:g} s; take a longer period"
            )
        return self

    @property
    def _held(self) -> tuple[str, ...]:
        """The names of what is held, as states: inputs, and torques at joints."""
        return (*self.driven, *(f"{self.name}_{joint}" for joint in self.torques))

    def sampling(self) -> Sampling:
        """When it samples, and what that sets."""
        return Sampling(
            period=self.period,
            delay=self.delay,
            noisy=tuple(name for name, s in self.sensors.items() if not is_zero(s.noise)),
            sets=(*self.sensors, *self.own_states),
            holds=self._held,
            inputs=tuple(self.driven),
            seed=self.seed,
        )

    def states(self, dimensions: int) -> tuple[ExtraState, ...]:
        """Readings, its own states, what it holds, and what is due after its delay."""
        read = (
            ExtraState(name, s.unit, s.about or f"reading of {self.name}", 0.0)
            for name, s in self.sensors.items()
        )
        own = (
            ExtraState(name, s.unit, s.about or f"state of {self.name}", s.initial)
            for name, s in self.own_states.items()
        )
        about = f"torque of {self.name}"
        held = (
            *(ExtraState(name, "", f"input held by {self.name}", 0.0) for name in self.driven),
            *(ExtraState(name, "", about, 0.0) for name in self._held[len(self.driven) :]),
        )
        due = (
            ExtraState(name, "", f"due input of {self.name}", 0.0)
            for names in self.sampling().due.values()
            for name in names
        )
        return (*read, *own, *held, *due)

    def rates(self, mechanism: Mechanism) -> tuple[Scalar, ...]:
        """Zeros: between samples nothing changes."""
        return (mechanism.zero,) * len(self.states(mechanism.dimensions))

    def samples(self, mechanism: Mechanism, noise: Mapping[str, Scalar]) -> Sequence[Scalar]:
        """The values that a sample gives: readings, its states, and what it holds."""
        read = {
            name: sensor.reading(mechanism, noise.get(name))
            for name, sensor in self.sensors.items()
        }
        following = (s.next for s in self.own_states.values())
        formulas = (*following, *self.driven.values(), *self.torques.values())
        return [*read.values(), *(mechanism.value(f, **read) for f in formulas)]

    def elements(self, layout: Layout) -> Iterator[AtJoint]:
        """A servo at each joint with a torque."""
        for joint in self.torques:
            yield AtJoint("servo", self.name, layout.child(joint), 0, layout.symbol)

    def loads(self, mechanism: Mechanism) -> Iterator[JointLoad]:
        """The torques that it holds."""
        for joint in self.torques:
            yield JointLoad(joint, mechanism.state(f"{self.name}_{joint}"))
