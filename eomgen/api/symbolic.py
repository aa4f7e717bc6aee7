"""A scene's program as expressions of another library: `casadi_functions`."""

from typing import TYPE_CHECKING

from eomgen.api.given import Outputs, Source, check, overridden
from eomgen.api.public import public
from eomgen.scene.schema import Form, Route
from eomgen.store import interfaced_program_of

if TYPE_CHECKING:
    from eomgen.exports.casadi import CasadiFunctions


@public
def casadi_functions(
    source: Source,
    *,
    form: Form | None = None,
    route: Route | None = None,
    outputs: Outputs | None = None,
) -> "CasadiFunctions":
    """The functions of a scene for CasADi, by name: `derivative` and the outputs.

    form     state form; None: the scene's own
    route    to the equations; None: the scene's own
    outputs  functions beside `derivative` and `jacobian`: names, or "all"; None: the scene's own

    Each is a `casadi.Function` of t, y, p and u, made of CasADi's expressions, SX. Raises
    `SceneError` if an option does not fit the scene, `RunError` if CasADi is not installed.
    """
    # Imported here: it is needed only where CasADi is.
    from eomgen.exports import casadi

    model = overridden(check(source), form=form, route=route, outputs=outputs)
    casadi.library()
    return casadi.casadi_functions(*interfaced_program_of(model))
