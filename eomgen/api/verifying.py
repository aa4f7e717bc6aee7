"""Comparison of the generated module with independent solvers: `verify`, `horizon`."""

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from eomgen.api.given import Source, model_of, read
from eomgen.api.inputs import Inputs, all_in_formulas
from eomgen.api.options import VerifyOptions, check_time
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.base.options import taking
from eomgen.model.model import Model
from eomgen.run.module import load_module
from eomgen.scene.schema import Simulation
from eomgen.store import generated_code

if TYPE_CHECKING:
    from eomgen.study.verification.horizon import Horizon
    from eomgen.study.verification.verify import Verified


@public
@taking(VerifyOptions)
def verify(options: VerifyOptions) -> "Verified":
    """Compare the generated module with an independent solver and with 60 digits.

    `missed` of the result lists the bounds that were exceeded. Raises `SceneError`, or `RunError`
    for an invalid argument.
    """
    scene = all_in_formulas(read(options.source), options.inputs)
    return verified_model(model_of(scene, options.source), scene.simulation, options)


@public
def horizon(source: Source, *, seconds: float = 60.0, inputs: Inputs | None = None) -> "Horizon":
    """Estimate for how long a run in doubles follows the exact motion of a scene.

    The run is compared with one in extended precision that takes at most `seconds`. `inputs` are
    as for `verify`. Raises `SceneError`, or `RunError` for an invalid argument.
    """
    scene = all_in_formulas(read(source), inputs)
    return horizon_of(model_of(scene, source), scene.simulation, seconds=seconds)


def verified_model(
    model: Model,
    simulation: Simulation,
    options: VerifyOptions,
    *,
    name: str = "",
    reporter: Reporter = SILENT,
) -> "Verified":
    """The result of `verify` for a model; `name` is the name of the scene in it."""
    from eomgen.study.verification.verify import verify as verified  # imports extended precision

    name = name or model.name
    wanted: dict[str, Any] = {
        "states": options.states,
        "seed": options.seed,
        "bound": options.bound,
    }
    with reporter.located(), reporter.progress(f"verifying {name}") as progress:
        found = verified(model, simulation, **wanted, progress=progress)
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

    check_time(seconds, reporter.argument("horizon"))
    model = replace(model, form="velocity")
    with reporter.located(), reporter.progress(f"horizon of {name or model.name}") as progress:
        module = load_module(generated_code(model).module, model.name)
        return found(model, simulation, module, seconds=seconds, progress=progress)


def digest(model: Model) -> str:
    """SHA-256 of the source of the verified module."""
    source = generated_code(replace(model, form="velocity")).module
    return hashlib.sha256(source.encode()).hexdigest()
