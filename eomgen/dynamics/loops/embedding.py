"""Constraints by embedded loops: every cluster is solved by itself, so the cost grows linearly.

The rows that `Model.pivots` names are solved for dependent velocities. The rows of other clusters
are kept by multipliers, within their cluster.
"""

from collections.abc import Callable, Sequence
from functools import cached_property

from eomgen.dynamics.loops.cluster_joint import Equation, Held, Independent, Joint
from eomgen.dynamics.loops.clusters import Cluster, accelerations_at_rest, clusters_of, span
from eomgen.dynamics.loops.constraints import (
    Symmetric,
    inner,
    relative,
)
from eomgen.dynamics.loops.embedded import Articulated, Response, articulate, respond
from eomgen.dynamics.loops.freedoms import Freedoms
from eomgen.dynamics.tree.forces import Wrench, no_wrench
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.scalars.protocol import Scalar

Forces = Callable[[Sequence[Scalar] | None], list[Scalar]]


class Embedded(Freedoms):
    """The constraints of a mechanism at a state.

    forces  generalised forces of the effects at joints with further ones
    biases  the wrenches that would make v̇ = 0
    beyond  the generalised forces besides the effects that v̇ takes
    fall    (nv,), the accelerations of trees on a free joint by uniform gravity
    """

    def __init__(
        self,
        d: MechanismState,
        forces: Forces,
        biases: Callable[[], Sequence[Wrench]],
        beyond: Callable[[Sequence[Scalar]], list[Scalar]],
        fall: Sequence[Scalar],
    ) -> None:
        super().__init__(d, fall)
        self._forces, self._biases, self._beyond = forces, biases, beyond
        self._names = [name for name, _ in d.model.rows]

    @cached_property
    def _columns(self) -> list[tuple[int, list[Scalar]]]:
        """Velocities along which clusters are solved, with their columns of motion."""
        return list(zip(self._independent, self._basis, strict=True))

    @cached_property
    def _rows_by_cluster(self) -> dict[Cluster, list[int]]:
        """The rows of each cluster that are kept by multipliers."""
        found: dict[Cluster, list[int]] = {cluster: [] for cluster in clusters_of(self._d)}
        for i, row in enumerate(self._d.rows):
            _, frames = span(self._d, row)
            if i not in self._order:
                cluster = next(c for c in found if frames & set(c.frames))
                found[cluster].append(i)
        return found

    @cached_property
    def _rest(self) -> list[Scalar]:
        """g̈ of each row at v̇ = `fall`."""
        pairs = zip(self._rows, accelerations_at_rest(self._d), strict=True)
        return [b + inner(row, self._fall, self._scalars) for row, b in pairs]

    def _equation(
        self, cluster: Cluster, velocities: Sequence[int], factors: Symmetric
    ) -> Equation:
        rows = self._rows_by_cluster[cluster]
        if not rows:
            return Independent(factors)
        jacobian = [[self._rows[i][j] for j in velocities] for i in rows]
        names = [self._names[i] for i in rows]
        return Held(factors, jacobian, [self._rest[i] for i in rows], names, self._scalars)

    @cached_property
    def _joints(self) -> Articulated:
        d = self._d
        names = [c.name for c in d.model.velocities]
        clusters = tuple(self._rows_by_cluster)
        return articulate(
            d.kinematics, clusters, self._columns, self._equation, names, self._scalars
        )

    @property
    def _held(self) -> list[tuple[Joint, Held]]:
        """The clusters that multipliers keep, with their equations."""
        joints = self._joints.joints.values()
        return [(joint, joint.equation) for joint in joints if isinstance(joint.equation, Held)]

    @cached_property
    def _under_effects(self) -> Response:
        return self._responded(None)

    def _responded(self, tau: Sequence[Scalar] | None) -> Response:
        return respond(
            self._d.kinematics,
            self._joints,
            self._columns,
            self._biases(),
            self._forces(tau),
            self._bend,
            self._scalars,
        )

    def forward(self, tau: Sequence[Scalar] | None) -> list[Scalar]:
        """v̇ under the effects and generalised forces `tau`."""
        found = self._responded(tau) if tau is not None else self._under_effects
        velocities = self._d.model.velocities
        pairs = zip(found.accelerations, self._fall, velocities, strict=True)
        return [self._scalars.named(a + b, c.acceleration) for a, b, c in pairs]

    def response(self, impulse: Sequence[Scalar]) -> list[Scalar]:
        """The change of the velocities by generalised impulses; the constraints stay met."""
        still = [no_wrench(self._scalars)] * len(self._d.kinematics.links)
        nothing = [self._zero] * self._d.nv
        found = respond(
            self._d.kinematics,
            self._joints,
            self._columns,
            still,
            impulse,
            nothing,
            self._scalars,
            still=True,
        )
        return found.accelerations

    def multipliers(self) -> list[Scalar]:
        """λ of the rows under the effects, N or N m."""
        found: dict[int, Scalar] = {}
        if self._order:
            over = self._beyond(self.forward(None))
            solved = self._factors.solved_transposed([over[j] for j in self._dependent])
            found |= zip(self._order, solved, strict=True)
        rights = self._under_effects.rights
        for joint, equation in self._held:
            rows = self._rows_by_cluster[joint.cluster]
            right = rights[joint.cluster.frames[0]]
            found |= zip(rows, equation.multipliers(right), strict=True)
        return [found[i] for i in range(len(self._names))]

    def _towards(self, along: Sequence[Scalar]) -> list[Scalar]:
        """Velocities v, the least in each cluster, with J v = -`along`."""
        found = self.dependents(along)
        for joint, equation in self._held:
            rows = self._rows_by_cluster[joint.cluster]
            still = [self._zero] * len(joint.velocities)
            change = equation.changed(still, equation.impulses([along[i] for i in rows]))
            for j, x in zip(joint.velocities, change, strict=True):
                found[j] = x
        return found

    def margins(self) -> list[Scalar]:
        """What of each row is independent of others, relative to the rows of its kind."""
        pivots = dict.fromkeys(range(len(self._names)), self._zero)
        sizes = dict(pivots)
        own = [inner(row, row, self._scalars) for row in self._jacobian]
        for i, square, size in zip(self._order, self._factors.squares(own), own, strict=True):
            pivots[i], sizes[i] = square, size
        for joint, equation in self._held:
            for n, i in enumerate(self._rows_by_cluster[joint.cluster]):
                pivots[i], sizes[i] = equation.small.d[n], equation.matrix[n][-1]
        return relative(self._d, list(pivots.values()), list(sizes.values()))
