"""Steps that are implicit in stiff loads, as an output of a module."""

from collections.abc import Sequence

from eomgen.codegen.recording import Recording
from eomgen.dynamics.loops.constraints import position_rates
from eomgen.dynamics.resisting import resisted
from eomgen.program.tape import Node


def implicit_step(record: Recording, length: Sequence[Node]) -> list[Node]:
    """The change of the state [q, v, x] in a step of a length h: velocities by `resisted`, then
    coordinates by the new velocities, and other states by their rates at the start.
    """
    d, model, (h,) = record.dynamics, record.model, length
    changes = [h * a for a in resisted(d, h)]
    after = [v + change for v, change in zip(record.v, changes, strict=True)]
    q = [h * rate for rate in position_rates(d, after)]
    x = [h * rate for rate in d.state_rates]
    kept = model.state_coordinates, model.state_velocities
    return [*(q[i] for i in kept[0]), *(changes[j] for j in kept[1]), *x]
