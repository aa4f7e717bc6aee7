"""Recording of a model's dynamics on a tape, up to the derivative of the state."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from eomgen.codegen.following import Following, positions
from eomgen.dynamics.dynamics import Forward, Values
from eomgen.dynamics.loops.constraints import position_rates
from eomgen.dynamics.regrouping import RegroupedDynamics
from eomgen.dynamics.tree.kinematics import Axes
from eomgen.model.model import Model
from eomgen.program.scalars import TapeScalars
from eomgen.program.tape import TIME, Node, Stage, Tape
from eomgen.tables.routes import ROUTES


class Recording:
    """A model's dynamics recorded on a tape by a route.

    model, route    as given
    tape, scalars   the tape, and the operations on its nodes
    parameters      parameters by name; `inputs` likewise
    q, v, x         coordinates, velocities, and extra states of effects
    dynamics        the recursions over these nodes
    forward         forward dynamics: v̇ under generalised forces beside the effects
    vd              v̇ under the effects alone
    position_rates  q̇
    state           inputs of the state: coordinates and velocities that do not follow from others
                    in closed form, and extra states; `rates` is its derivative
    """

    def __init__(
        self,
        model: Model,
        route: str,
        forward: Callable[["Recording"], Forward] | None = None,
        axes: Axes | None = None,
        tape: Tape | None = None,
    ) -> None:
        """Record a model.

        forward  makes forward dynamics of a recording, instead of the route's recursion
        axes     axes in which the recursion works, instead of its usual ones
        tape     tape to record on, instead of a new one
        """
        self.model = model
        self.route = route
        self.tape = tape or Tape()
        self.scalars = TapeScalars(self.tape)
        self.parameters = {p.name: self.input(p.name, Stage.PARAMETERS) for p in model.parameters}
        self.q = [self.input(c.name, Stage.POSITIONS) for c in model.coordinates]
        self.v = [self.input(c.name, Stage.VELOCITIES) for c in model.velocities]
        self.inputs = {i.name: self.input(i.name, Stage.INPUTS) for i in model.inputs}
        self.x = [self.input(x.name, Stage.VELOCITIES) for x in model.extra]
        extra = {x.name: node for x, node in zip(model.extra, self.x, strict=True)}
        time = self.input(TIME, Stage.INPUTS)
        values = Values(self.parameters, self.inputs, self.q, self.v, extra, time)
        own: Axes | None = "own" if ROUTES[route].frame_axes else axes
        self.dynamics = RegroupedDynamics(model, values, self.scalars, own)
        self.forward: Forward
        self.forward = self.dynamics.forward(route) if forward is None else forward(self)
        self.vd = self.dynamics.vd = self.forward(None)
        self.position_rates = position_rates(self.dynamics)
        self._following = self._followed() if model.groups else None
        q, v = model.state_coordinates, model.state_velocities
        self.state = [*(self.q[i] for i in q), *(self.v[j] for j in v), *self.x]
        rates = [*(self.position_rates[i] for i in q), *(self.vd[j] for j in v)]
        self.rates = self.closed([*rates, *self.dynamics.state_rates])

    def closed(self, nodes: Sequence[Node]) -> list[Node]:
        """Nodes as functions of the state: without coordinates and velocities that follow."""
        return self._following.of(nodes) if self._following else list(nodes)

    @property
    def ranges(self) -> dict[str, Node]:
        """Of angles that follow, by name, how far each is from where it jumps, 1 to 0."""
        return self._following.margins if self._following else {}

    def _followed(self) -> Following:
        """Coordinates and velocities that follow from others."""
        following, d = positions(self.dynamics, self.q, self.tape), self.dynamics
        free, still = set(self.model.state_velocities), self.scalars.number(0.0)
        v = [node if j in free else still for j, node in enumerate(self.v)]
        moving = type(d)(self.model, replace(d.values, v=v), self.scalars, d.axes)
        held = moving.by_independent_velocities
        along = held.carried_along() if self.route == "independent" else held.velocity()
        for j, value in enumerate(along):
            if j not in free:
                following.put(self.v[j], value)
                following.inputs.add(self.v[j].index)
        return following

    def input(self, name: str, stage: Stage) -> Node:
        """An input of the program."""
        return self.tape.input(name, stage)

    def velocity_inputs(self, prefix: str) -> list[Node]:
        """One further input for each velocity, named after it with a prefix."""
        names = (f"{prefix}__{c.name}" for c in self.model.velocities)
        return [self.input(name, Stage.INPUTS) for name in names]
