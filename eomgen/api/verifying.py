"""Comparison of the generated module with independent solvers: `verify`, `horizon`."""

import hashlib
import math
from dataclasses import replace
from typing import TYPE_CHECKING

from eomgen.api.given import Source, check_states, check_time, model_of, read
from eomgen.api.inputs import Inputs, all_in_formulas
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.base.errors import RunError
from eomgen.model.model import Model
from eomgen.run.module import load_module
from eomgen.scene.schema import Simulation
from eomgen.store import generated_code

if TYPE_CHECKING:
    from eomgen.study.verification.horizon import Horizon
    from eomgen.study.verification.verify import Verified

MOST_STATES = 10_000


@public
def verify(
    source: Source,
    *,
    states: int | None = None,
    seed: int = 0,
    bound: float | None = None,
    inputs: Inputs | None = None,
) -> "Verified":
    """Compare the generated module with an independent solver and with 60 digits.

    `missed` of the result lists the bounds that were exceeded.

    states  number of states of each kind; None: as many as are quick
    seed    of the random states
    bound   greatest error of v̇, units in the last place; None: the effect of errors of half a unit
            in the data
    inputs  constants, formulas or a table in place of inputs, as for `simulate`; others are
            sampled, and 0 in the scene's own run

    Raises `SceneError`, or `RunError` for an invalid argument.
    """
    scene = all_in_formulas(read(source), inputs)
    return verified_model(
        model_of(scene, source), scene.simulation, states=states, seed=seed, bound=bound
    )


@public
def horizon(source: Source, *, seconds: float = 60.0, inputs: Inputs | None = None) -> "Horizon":
    """Estimate for how long a run in doubles follows the exact motion of a scene.

    The run is compared with one in extended precision that takes at most `seconds`. `inputs` are
    as for `verify`. Raises `SceneError`, or `RunError` for an invalid argument.
    """
    scene = all_in_formulas(read(source), inputs)
    return horizon_of(model_of(scene, source), scene.simulation, seconds=seconds)


def check_verification(
    *,
    states: int | None = None,
    seed: int = 0,
    bound: float | None = None,
    horizon: float | None = None,
    reporter: Reporter = SILENT,
) -> None:
    """Raise `RunError` for an invalid argument of `verify` or `horizon`."""
    check_states(states, seed, MOST_STATES, reporter)
    if bound is not None and not 0.5 <= bound < math.inf:
        argument = reporter.argument("bound")
        raise RunError(f"{argument}: {bound:g} ulps is not a bound; give 0.5 or more")
    if horizon is not None:
        check_time(horizon, reporter.argument("horizon"))


def verified_model(
    model: Model,
    simulation: Simulation,
    *,
    states: int | None = None,
    seed: int = 0,
    bound: float | None = None,
    name: str = "",
    reporter: Reporter = SILENT,
) -> "Verified":
    """The result of `verify` for a model; `name` is the name of the scene in it."""
    from eomgen.study.verification.verify import verify as verified  # imports extended precision

    check_verification(states=states, seed=seed, bound=bound, reporter=reporter)
    name = name or model.name
    with reporter.located(), reporter.progress(f"verifying {name}") as progress:
        found = verified(
            model, simulation, states=states, seed=seed, bound=bound, progress=progress
        )
    return replace(found, name=name)


def horizon_of(
    model: Model,
    simulation: Simulation,
    *,
    seconds: float,
    name: str = "",
    reporter: Reporter = SILENT,
) -> "Horizon":
    """The result of `horizon` for a model; `name` is the name of the scene in messages."""
    from eomgen.study.verification.horizon import horizon as found

    check_verification(horizon=seconds, reporter=reporter)
    model = replace(model, form="velocity")
    with reporter.located(), reporter.progress(f"horizon of {name or model.name}") as progress:
        module = load_module(generated_code(model).module, model.name)
        return found(model, simulation, module, seconds=seconds, progress=progress)


def digest(model: Model) -> str:
    """SHA-256 of the source of the verified module."""
    source = generated_code(replace(model, form="velocity")).module
    return hashlib.sha256(source.encode()).hexdigest()
