"""A generated module against an independent solver and 60 digits: `verify`."""

import hashlib
import math
from dataclasses import replace
from typing import TYPE_CHECKING

from eomgen.commands.shared import Arguments, located, read_whole
from eomgen.errors import RunError
from eomgen.model.model import Model
from eomgen.run.module import load_module
from eomgen.run.progress import terminal_progress
from eomgen.scene.schema import Simulation
from eomgen.store import generated_code

if TYPE_CHECKING:
    from eomgen.study.verification.horizon import Horizon

MOST_STATES = 10_000


def verify(given: Arguments) -> int:
    """Verify, print, write the evidence if asked; raise `RunError` when a bound is missed."""
    # Imported here: nothing else needs that many digits.
    from eomgen.study.verification import evidence
    from eomgen.study.verification.verify import verify as verified

    if given.states is not None and not 1 <= given.states <= MOST_STATES:
        raise RunError(f"--states: {given.states} is not a number from 1 to {MOST_STATES}")
    if given.seed < 0:
        raise RunError(f"--seed: {given.seed} is negative; give 0, 1, 2, …")
    if given.bound is not None and not 0.5 <= given.bound < math.inf:
        raise RunError(f"--bound: {given.bound:g} is no number of ulps from 0.5 on")
    if given.horizon is not None and not 0 < given.horizon < math.inf:
        raise RunError(f"--horizon: {given.horizon:g} is no positive time; give one in s")
    scene, model, name = read_whole(given.scene, given)
    if given.save is not None:
        evidence.paths(given.save, name, force=given.force)
    with located(given.scene), terminal_progress(f"verifying {name}") as progress:
        found = replace(
            verified(
                model,
                scene.simulation,
                states=given.states,
                seed=given.seed,
                bound=given.bound,
                progress=progress,
            ),
            name=name,
        )
    horizon = _horizon(given, model, scene.simulation, name)
    lines = evidence.report(found, horizon)
    print("\n".join(lines))
    if given.save is not None:
        source = generated_code(replace(model, form="velocity")).module
        data = evidence.evidence(found, horizon, hashlib.sha256(source.encode()).hexdigest())
        for path in evidence.save(given.save, name, lines, data, force=given.force):
            print(f"    wrote {path}")
    if found.missed:
        raise RunError(*(f"{name}: {line}" for line in evidence.missed(found)))
    return 0


def _horizon(given: Arguments, model: Model, wanted: Simulation, name: str) -> "Horizon | None":
    from eomgen.study.verification.horizon import horizon

    if given.horizon is None:
        return None
    model = replace(model, form="velocity")
    with located(given.scene), terminal_progress(f"horizon of {name}") as progress:
        module = load_module(generated_code(model).module, model.name)
        return horizon(model, wanted, module, seconds=given.horizon, progress=progress)
