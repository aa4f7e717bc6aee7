"""A run as values: the mechanism, its module, the trajectory, and what it was run with."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from eomgen.base.displays import Displayed
from eomgen.base.frozen import Frozen
from eomgen.model.model import Model
from eomgen.results.module import Module
from eomgen.run.problem import FloatArray
from eomgen.run.trajectory import Outcome, Trajectory
from eomgen.scene.schema import Simulation


@dataclass(frozen=True, eq=False, repr=False)
class Simulated(Frozen, Displayed):
    """What was simulated; see `Run`, which adds how it was chosen and what it looks like."""

    model: Model
    module: Module
    trajectory: Trajectory
    simulation: Simulation = field(default_factory=Simulation)
    inputs: Mapping[str, float] = field(default_factory=dict)
    varying: bool = False

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self.model.name

    @property
    def t(self) -> FloatArray:
        """Times, (n,), s."""
        return self.trajectory.t

    @property
    def y(self) -> FloatArray:
        """States, (n, ny), SI units, in the order of `states`."""
        return self.trajectory.y

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.trajectory.states

    @property
    def finished(self) -> bool:
        """Whether the run reached its end time."""
        return self.trajectory.finished

    @property
    def outcome(self) -> Outcome:
        """How the run ended: kind, reason, and what to change."""
        return self.trajectory.outcome

    @property
    def message(self) -> str:
        """Why the run ended early, and what to change; "" if there is nothing to report."""
        return self.trajectory.message

    @property
    def saved(self) -> Mapping[str, FloatArray]:
        """What `save` asked for, (n, …) each, by output."""
        return {name: each.values for name, each in self.trajectory.saved.items()}
