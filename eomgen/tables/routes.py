"""The routes: algorithms by which accelerations are derived.

The table gives the schema and the command line the names, `Dynamics` the recursion, and recording
the way derivatives are taken. To add a route, add its entry here and to
`dynamics.dynamics.Dynamics` the methods that its `recursion` names.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class RouteSpec:
    """One route.

    about           a description
    recursion       name of the algorithm that solves for accelerations and for responses to
                    impulses: `Dynamics` has methods of this name that end in `_forward` and
                    `_response`
    symbolic        whether SymPy solves for v̇, and the recursion serves responses only
    frame_axes      whether the recursion works in body axes only
    differentiated  whether derivatives of v̇ are taken of the steps that compute it; else inverse
                    dynamics is differentiated and solved with the factors of M
    last            whether `auto` tries it only if all others lose too many digits
    loops           whether it is for mechanisms with constraints only
    trees           whether it is for mechanisms without constraints only
    """

    about: str
    recursion: str
    symbolic: bool = False
    frame_axes: bool = False
    differentiated: bool = False
    last: bool = False
    loops: bool = False
    trees: bool = False


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
    "independent": RouteSpec(
        "for loops: dependent velocities solved for, one equation for each degree of freedom",
        "independent",
        loops=True,
    ),
    "embedded": RouteSpec(
        "for loops: each eliminated as one joint of the articulated-body recursion; the cost grows "
        "linearly with their number",
        "embedded",
        loops=True,
    ),
    "mixed": RouteSpec(
        "orthogonal elimination along the joints that lose digits, articulated bodies elsewhere",
        "mixed",
        frame_axes=True,
        differentiated=True,
        last=True,
        trees=True,
    ),
    "orthogonal": RouteSpec(
        "orthogonal elimination on Gauss's principle: keeps digits where masses or angles are "
        "uneven",
        "orthogonal",
        frame_axes=True,
        differentiated=True,
        last=True,
    ),
}


def routes_for(loops: bool) -> list[str]:
    """The routes for mechanisms with or without constraints, in order."""
    return [n for n, spec in ROUTES.items() if not (spec.trees if loops else spec.loops)]
