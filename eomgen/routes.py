"""The routes from a model to accelerations: one table.

The schema and the command line take the names from it, the recursions what computes v̇, the stage
that records equations how derivatives are taken. To add a route, add its entry here and to
`dynamics.dynamics.Dynamics` the methods that its `recursion` names.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class RouteSpec:
    """One route.

    about           what it is
    recursion       what solves for accelerations and for responses to impulses: `Dynamics` has
                    methods of this name that end in `_forward` and `_response`
    symbolic        whether v̇ is solved for by SymPy, and the recursion serves responses alone
    frame_axes      whether the recursion works in the frames' own axes only
    differentiated  whether derivatives of v̇ are those of its own steps; else M is factored, and
                    inverse dynamics differentiated
    last            whether `auto` tries it only where all others lose too many digits
    """

    about: str
    recursion: str
    symbolic: bool = False
    frame_axes: bool = False
    differentiated: bool = False
    last: bool = False


ROUTES: dict[str, RouteSpec] = {
    "closed": RouteSpec(
        "joint constraints differentiated twice, forces eliminated, M v̇ = F - V - G solved by "
        "SymPy; for small trees",
        "articulated",
        symbolic=True,
        differentiated=True,
    ),
    "ldl": RouteSpec(
        "mass matrix by composite rigid bodies, factored as LᵀDL over the tree's own sparsity",
        "factored",
    ),
    "aba": RouteSpec("articulated bodies: the cost grows linearly with the tree", "articulated"),
    "orthogonal": RouteSpec(
        "orthogonal elimination on Gauss's principle: keeps digits where masses or angles are "
        "uneven",
        "orthogonal",
        frame_axes=True,
        differentiated=True,
        last=True,
    ),
}
