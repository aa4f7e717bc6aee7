"""The command `certify`."""

import math
from pathlib import Path

from eomgen.api.certifying import certified, certified_run
from eomgen.api.given import named
from eomgen.api.options import CertifyOptions, as_flag
from eomgen.api.reopening import load_run
from eomgen.api.reporter import Reporter
from eomgen.api.states import state_names
from eomgen.base.errors import RunError
from eomgen.base.files import check_writable
from eomgen.commands.durations import timed_notice
from eomgen.commands.shared import (
    Arguments,
    assignments,
    given_inputs,
    located,
    note,
    print_wrapped,
    read_whole,
    reporter_of,
)
from eomgen.commands.usage import taken
from eomgen.results.enclosed import Enclosure


def certify(given: Arguments) -> int:
    """Print boxes that hold the last state, or bounds of the error of a run; write all rows."""
    if given.output is not None:
        if given.output.suffix.lower() not in (".csv", ".json"):
            raise RunError(f"{given.output}: give a name that ends in .csv or .json")
        check_writable(given.output, force=given.force)
    found = _of_run(given) if Path(given.scene).suffix.lower() == ".npz" else _of_scene(given)
    _print(found)
    if given.output is not None:
        found.save(given.output, force=given.force)
        print(f"    wrote {given.output}")
    return 0 if found.finished else 1


def _of_scene(given: Arguments) -> Enclosure:
    scene, model, _ = read_whole(given.scene, given)
    with located(given.scene):
        state = assignments(given.state, state_names(model), "--state")
    options = taken(
        CertifyOptions,
        given,
        source=scene,
        parameters=assignments(given.parameters, model.defaults, "--set"),
        state=state,
        inputs=given_inputs(given.inputs, [i.name for i in model.inputs]),
        uncertain=_widths(given.uncertain),
    )
    t_end = scene.simulation.t_end if options.t_end is None else options.t_end
    return certified(model, options, t_end, reporter_of(given, given.scene))


def _of_run(given: Arguments) -> Enclosure:
    reporter = Reporter(argument=as_flag, note=lambda text: note(given, text), waiting=timed_notice)
    options = taken(
        CertifyOptions,
        given,
        source=given.scene,
        parameters=dict.fromkeys(given.parameters, 0.0),
        state=dict.fromkeys(given.state, 0.0),
        inputs=dict.fromkeys(given.inputs, 0.0),
        uncertain=_widths(given.uncertain),
    )
    return certified_run(load_run(given.scene), options, reporter)


def _widths(texts: list[str]) -> dict[str, float]:
    """The values of NAME=X."""
    pairs = [text.partition("=") for text in texts]
    for name, sign, value in pairs:
        if not sign:
            raise RunError(f"--uncertain {name}: gives no width; write --uncertain {name}=0.01")
        named({name: value}, [name], "--uncertain", "width")  # type: ignore[dict-item]
    return {name.strip(): float(value) for name, _, value in pairs}


def _print(found: Enclosure) -> None:
    print(
        f"{found.name}: proven to t = {found.t[-1]:g} s in {found.steps} steps of order "
        f"{found.order}, {found.bits} bits"
    )
    width = max(map(len, found.states))
    for j, name in enumerate(found.states):
        off = math.nextafter(abs(found.low[-1, j]) + found.radius[-1, j], math.inf)
        text = f"    {name:<{width}}  {found.y[-1, j]: .17g} ± {off:.2g}"
        if found.error is not None:
            text += f"   error of the run at most {found.error[:, j].max():.3g}"
        print(text)
    if found.error is None:
        print(f"radius      at most {found.largest:.2g} at all {found.t.size} rows")
    else:
        assert found.least is not None
        print(
            f"error       between {found.least.max():.3g} and {found.error.max():.3g}, the "
            f"greatest of all states at {found.t.size} rows"
        )
    if found.message:
        print_wrapped("note        ", found.message)
