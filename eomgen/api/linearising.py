"""Linearisation about an equilibrium or a state: `linearise`."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from eomgen.api.generating import compiled
from eomgen.api.given import Source, Values, check, read, values_of
from eomgen.api.inputs import constant_inputs
from eomgen.api.options import PointOptions
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.api.states import initial_with, state_names, values_by_index
from eomgen.base.errors import RunError
from eomgen.base.options import taking
from eomgen.language.base import identifier
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.study.diagnosis import problem_of

if TYPE_CHECKING:
    from eomgen.study.linear.linearise import Linearisation


@dataclass(frozen=True, eq=False)
class Linearised:
    """A linearisation with what it was made from.

    module         the module that was linearised, of form 'velocity'
    start          the given state (ny,), from which an equilibrium was searched for
    linearisation  A, B and the point
    steady         whether a given state moves steadily: no velocity changes
    """

    module: GeneratedModule
    start: FloatArray
    linearisation: "Linearisation"
    steady: bool


@public
@taking(PointOptions)
def linearise(options: PointOptions) -> "Linearisation":
    """Linearise a scene: A and B of δẏ = A δy + B δu about an equilibrium or a state.

    Controllers that sample are left out, and the inputs that they drive are inputs; `discrete` of
    the result gives the system from one sample to the next. Raises `SceneError`, or `RunError` for
    an invalid argument or if there is no equilibrium.
    """
    return linearised_at(linearisable(plant_of(options.source)), options).linearisation


def plant_of(source: Source) -> Model:
    """The model of a scene without what samples: of its controllers the inputs are left."""
    model = check(source)
    if not model.sampled:
        return model
    scene = read(source)
    effects = tuple(effect for effect in scene.effects if effect.sampling() is None)
    return check(scene.replaced(effects=effects))


def linearisable(model: Model) -> Model:
    """A model in form 'velocity' with the outputs that its linearisation needs.

    In the other forms the initial state depends on the parameters. All coordinates are states: an
    equilibrium may be where those taken as independent are not.
    """
    needed = ("input_jacobian",) if model.inputs else ()
    return replace(model, form="velocity", outputs=needed, loops_kept="projected")


def linearised_at(model: Model, point: PointOptions, reporter: Reporter = SILENT) -> Linearised:
    """A `linearisable` model, linearised as `linearise` describes."""
    # Imported here: they import SciPy.
    from eomgen.study.linear.equilibrium import equilibrium
    from eomgen.study.linear.linearise import is_steady
    from eomgen.study.linear.linearise import linearise as linearised

    at = point.at
    hold, trim = (tuple(map(identifier, names)) for names in (point.hold, point.trim))
    constants = constant_inputs(point.inputs, reporter)
    parameters, inputs = values_of(model, point.parameters, constants, reporter)
    _, module = compiled(model, reporter=reporter)
    with reporter.located():
        problem = problem_of(module, parameters or None, inputs or None, model)
        y = start = _start(model, problem.initial, point, reporter, parameters)
        u: Mapping[str, float] | FloatArray = inputs
        if at != "initial":
            settle = at == "rest"
            with reporter.waiting(f"searching for an equilibrium of {model.name} …"):
                y, u = equilibrium(
                    module, y, inputs, parameters, hold=hold, trim=trim, settle=settle
                )
        elif hold or trim:
            raise RunError(
                f"{reporter.argument('hold')}, {reporter.argument('trim')}: are for finding an "
                f"equilibrium; leave out {reporter.argument('at')} initial"
            )
        found = linearised(module, y, u, parameters)
        steady = at == "initial" and is_steady(module, found, parameters)
    return Linearised(module, start, found, steady)


def _start(
    model: Model, initial: FloatArray, point: PointOptions, reporter: Reporter, parameters: Values
) -> FloatArray:
    """The initial state with the given values."""
    given = values_by_index(model, point.state, reporter)
    nq, nv = len(model.coordinates), len(model.velocities)
    for index in given:
        if point.at != "initial" and nq <= index < nq + nv:
            raise RunError(
                f"{reporter.argument('state')} {state_names(model)[index]}: an equilibrium is at "
                f"rest; leave it out, or give {reporter.argument('at')} initial"
            )
    return initial_with(model, initial, given, reporter, parameters)
