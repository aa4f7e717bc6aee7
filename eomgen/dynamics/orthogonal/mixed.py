"""The part of a tree that articulated bodies eliminate in a mixed recursion.

Joints that carry a heavy subtree on a light body lose digits there, and so may all between them and
the world. These are eliminated orthogonally (`orthogonal`). All other joints form subtrees that end
in leaves. Articulated bodies eliminate these in less than half the operations. What is left of such
a subtree at its first joint, an inertia I and a bias wrench p, is handed over as rows: with
I = Σ d c cᵀ (Cholesky's factors without roots) and Σ d s c = -p

    ½ xᵀ I x + p · x = Σ ½ d (c · x - s)² + constant.
"""

from collections.abc import Collection, Sequence

from eomgen.dynamics.orthogonal.rows import Row, Rows
from eomgen.dynamics.tree.articulated import articulate_links, inwards
from eomgen.dynamics.tree.forces import Wrench, at_parent, less, moved_to, total
from eomgen.dynamics.tree.frames import Linkage
from eomgen.dynamics.tree.kinematics import Link
from eomgen.dynamics.tree.motion import Acceleration, inertial_force
from eomgen.dynamics.tree.vectors import AXES, Vec, sub, zeros
from eomgen.scalars.protocol import Scalar, Scalars

HEAVY = 1e3
"""A subtree this many times as heavy as the body that carries it costs digits."""
SLIGHT = 1e-15
"""A pivot of a handed inertia is at least this part of its diagonal entry."""


def well_conditioned(linkage: Linkage) -> frozenset[int]:
    """The frames of a linkage over floats that articulated bodies eliminate: those of which neither
    they nor any frame on them carries a subtree `HEAVY` times as heavy as its own body.
    """
    frames = linkage.frames
    whole = [float(frame.rigid.mass) for frame in frames]
    uneven = [False] * len(frames)
    for k in reversed(range(len(frames))):
        parent = frames[k].parent
        if parent >= 0:
            own = float(frames[parent].rigid.mass)
            uneven[parent] |= uneven[k] or 0.0 < HEAVY * own < whole[k]
            whole[parent] += whole[k]
    return frozenset(k for k in range(len(frames)) if not uneven[k])


class ArticulatedPart:
    """The links of a tree, in their own axes, that are eliminated as articulated bodies: with each
    in `which` all that it carries. `pivots` are those of each link, () of the others.
    """

    def __init__(self, links: Sequence[Link], which: Collection[int], scalars: Scalars) -> None:
        self.which = which
        self._links, self._scalars = links, scalars
        self.pivots, self._inertias = articulate_links(links, which, scalars)

    def biases(
        self,
        frame_accelerations: Sequence[Acceleration],
        wrenches: Sequence[Wrench],
        centres: Sequence[Vec],
    ) -> dict[int, Wrench]:
        """The wrenches on these links that would make v̇ = 0, about their origins, with given
        `wrenches` about the `centres` of mass.
        """
        found = {}
        for k in sorted(self.which):
            own = Wrench(*inertial_force(self._links[k], frame_accelerations[k], self._scalars))
            applied = moved_to(sub(zeros(self._scalars), centres[k]), wrenches[k])
            found[k] = less(own, applied)
        return found

    def inwards(
        self, k: int, sums: dict[int, Wrench], tau: Sequence[Scalar], shares: list[Scalar]
    ) -> Wrench | None:
        """Eliminate link k from the bias wrenches `sums`, which its parent's joins if that is one
        of these links; else what is left of it, to be handed over.
        """
        link = self._links[k]
        p = inwards(link, self.pivots[k], sums[k], tau, shares)
        if link.parent not in self.which:
            return p if link.parent >= 0 else None
        sums[link.parent] = total(sums[link.parent], at_parent(link, p))
        return None

    def handed_over(self, k: int, bias: Wrench, rows: Rows) -> tuple[list[Row], Wrench]:
        """What is left of link k and all that it carries, as rows in its axes; and the wrench along
        the axes that it is free to move along.
        """
        inertia, scalars = self._inertias[k], self._scalars
        J, G, H = inertia.J, inertia.G, inertia.H
        work: list[list[Scalar]] = [[*H[i], G[0][i], G[1][i], G[2][i]] for i in AXES]
        work += [[*G[i], *J[i]] for i in AXES]
        left = [-x for x in (*bias.force, *bias.moment)]
        found = []
        whole = [work[i][i] for i in range(6)]
        for i in range(6):
            if scalars.is_zero(whole[i]):
                continue
            # Along others that it is free to move along, rounding leaves a little of either sign.
            d = work[i][i]
            if d is not whole[i]:
                d = scalars.call("max", d, scalars.number(SLIGHT) * whole[i])
            parts = {j: work[i][j] / d for j in range(i + 1, 6)}
            entries = [parts.get(j, rows.one if j == i else rows.zero) for j in range(6)]
            for j, part in parts.items():
                left[j] = left[j] - part * left[i]
                for h in range(i + 1, 6):
                    work[j][h] = work[j][h] - part * work[i][h]
            a, b, c, p, q, r = entries
            found.append(rows.make(d, (p, q, r), (a, b, c), left[i] / d, rows.zero))
            left[i] = rows.zero
        return found, Wrench((left[3], left[4], left[5]), (left[0], left[1], left[2]))
