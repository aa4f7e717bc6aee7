"""The generated module against independent solvers: `verify`, `horizon`."""

import hashlib
import math
from dataclasses import replace
from typing import TYPE_CHECKING

from eomgen.api.given import Source, check, check_time, read
from eomgen.api.reporter import SILENT, Reporter
from eomgen.errors import RunError
from eomgen.model.model import Model
from eomgen.run.module import load_module
from eomgen.scene.schema import Simulation
from eomgen.store import generated_code

if TYPE_CHECKING:
    from eomgen.study.verification.horizon import Horizon
    from eomgen.study.verification.verify import Verified

MOST_STATES = 10_000


def verify(
    source: Source, *, states: int | None = None, seed: int = 0, bound: float | None = None
) -> "Verified":
    """The generated module against a solver of another make and against 60 digits; what it
    `missed` is empty where all is well.

    states  how many of each kind; None: as many as are quick
    seed    of the random ones
    bound   units in the last place that v̇ may be off; None: what half a unit in the data allows

    Raises `RunError` for an argument that cannot be served.
    """
    scene = read(source)
    return verified_model(check(scene), scene.simulation, states=states, seed=seed, bound=bound)


def horizon(source: Source, *, seconds: float = 60.0) -> "Horizon":
    """How long doubles mean anything, by a run in extended precision of at most so many `seconds`.

    Raises `RunError` for an argument that cannot be served.
    """
    scene = read(source)
    return horizon_of(check(scene), scene.simulation, seconds=seconds)


def check_verification(
    *,
    states: int | None = None,
    seed: int = 0,
    bound: float | None = None,
    horizon: float | None = None,
    reporter: Reporter = SILENT,
) -> None:
    """Raise `RunError` for what cannot be served."""
    if states is not None and not 1 <= states <= MOST_STATES:
        asked = reporter.argument("states")
        raise RunError(f"{asked}: {states} is not a number from 1 to {MOST_STATES}")
    if seed < 0:
        raise RunError(f"{reporter.argument('seed')}: {seed} is negative; give 0, 1, 2, …")
    if bound is not None and not 0.5 <= bound < math.inf:
        asked = reporter.argument("bound")
        raise RunError(f"{asked}: {bound:g} is no number of ulps from 0.5 on")
    if horizon is not None:
        check_time(horizon, reporter.argument("horizon"))


def verified_model(
    model: Model,
    wanted: Simulation,
    *,
    states: int | None = None,
    seed: int = 0,
    bound: float | None = None,
    name: str = "",
    reporter: Reporter = SILENT,
) -> "Verified":
    """A model verified as `verify` describes it; `name` is what it is called there."""
    from eomgen.study.verification.verify import verify as verified  # brings many digits

    check_verification(states=states, seed=seed, bound=bound, reporter=reporter)
    called = name or model.name
    with reporter.located(), reporter.progress(f"verifying {called}") as progress:
        found = verified(model, wanted, states=states, seed=seed, bound=bound, progress=progress)
    return replace(found, name=called)


def horizon_of(
    model: Model, wanted: Simulation, *, seconds: float, name: str = "", reporter: Reporter = SILENT
) -> "Horizon":
    """What `horizon` says of a model, which `name` is what it is called."""
    from eomgen.study.verification.horizon import horizon as found

    check_verification(horizon=seconds, reporter=reporter)
    model = replace(model, form="velocity")
    with reporter.located(), reporter.progress(f"horizon of {name or model.name}") as progress:
        module = load_module(generated_code(model).module, model.name)
        return found(model, wanted, module, seconds=seconds, progress=progress)


def digest(model: Model) -> str:
    """SHA-256 of the source of the module that is verified."""
    source = generated_code(replace(model, form="velocity")).module
    return hashlib.sha256(source.encode()).hexdigest()
