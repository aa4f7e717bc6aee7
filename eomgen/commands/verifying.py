"""The command `verify`."""

from eomgen.api.inputs import all_in_formulas
from eomgen.api.options import VerifyOptions
from eomgen.api.verifying import digest, horizon_of, verified_model
from eomgen.base.errors import InterruptedRunError, RunError
from eomgen.commands.options import Evidence
from eomgen.commands.shared import Arguments, read_whole, reporter_of, scene_with_inputs
from eomgen.commands.usage import taken


def verify(given: Arguments) -> int:
    """Verify, print the report, write it if asked. Raises `RunError` if a bound is exceeded."""
    # Imported here: it imports extended precision.
    from eomgen.study.verification import evidence

    options = taken(VerifyOptions, given, source=given.scene)
    taken(Evidence, given)
    reporter = reporter_of(given, given.scene)
    tables = all_in_formulas(*scene_with_inputs(given), reporter)
    scene, model, name = read_whole(given.scene, given, tables)
    if given.save is not None:
        evidence.paths(given.save, name, force=given.force)
    found = verified_model(model, scene.simulation, options, name=name, reporter=reporter)
    horizon = None
    if given.horizon is not None and not found.stopped:
        settings = scene.simulation
        horizon = horizon_of(model, settings, seconds=given.horizon, name=name, reporter=reporter)
    lines = evidence.report(found, horizon)
    print("\n".join(lines))
    if given.save is not None and not found.stopped:
        data = evidence.evidence(found, horizon, digest(model))
        for path in evidence.save(given.save, name, lines, data, force=given.force):
            print(f"    wrote {path}")
    if found.stopped:
        raise InterruptedRunError(f"{name}: {found.stopped}; the report is of these")
    if found.missed:
        raise RunError(*(f"{name}: {line}" for line in evidence.missed(found)))
    return 0
