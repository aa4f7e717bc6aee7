"""What commands share: reading a scene, values given as NAME=X, printing lists."""

import argparse
import math
import sys
import textwrap
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from eomgen.api.given import Outputs, check_name, check_outputs, modelled
from eomgen.api.inputs import Given, read_table
from eomgen.api.options import as_flag
from eomgen.api.overlaps import overlaps_at_start
from eomgen.api.reporter import Reporter
from eomgen.base.errors import RunError
from eomgen.base.text import one_line
from eomgen.commands.durations import timed_notice
from eomgen.language.angles import number_with_unit
from eomgen.language.base import identifier
from eomgen.model.inputs import all_inputs
from eomgen.model.model import Model
from eomgen.run.progress import terminal_progress
from eomgen.scene.reader import find_scene, read_scene, scene_text
from eomgen.scene.schema import Scene

Arguments = argparse.Namespace

FEW = 40
"""Longer lists are shortened."""


def read_model(scene: str, given: Arguments) -> tuple[Model, str]:
    """As `read_whole`, without the scene."""
    return read_whole(scene, given)[1:]


def read_whole(
    scene: str, given: Arguments, tables: Scene | None = None
) -> tuple[Scene, Model, str]:
    """A scene, or the `tables` already read, its model with the options of the command line, and
    the name of files made from it.

    The name ends in the form and the route if these are not the scene's own.
    """
    reporter = reporter_of(given, scene)
    outputs: Outputs | None = getattr(given, "outputs", None)
    if outputs is not None:
        check_outputs(outputs, reporter)
    tables = read_scene(scene) if tables is None else tables
    form, route = getattr(given, "form", None), getattr(given, "route", None)
    model = modelled(tables, form=form, route=route, outputs=outputs, reporter=reporter)
    name = model.name
    if model.form != tables.form:
        name = f"{name}_{model.form}"
    if model.route != tables.route:
        name = f"{name}_{model.route}"
    return tables, model, name


def required(given: Arguments, model: Model) -> Sequence[str]:
    """Outputs that the command line lists, with those they need."""
    return () if given.outputs in (None, "all") else model.outputs


def reporter_of(given: Arguments, scene: str) -> Reporter:
    """The reporter of the command line for a scene."""
    path = find_scene(scene)
    return Reporter(
        scene=path.name,
        text=lambda: scene_text(path),
        argument=as_flag,
        note=lambda notice: note(given, notice),
        trial=lambda text: print(f"    trying {text}", flush=True),
        waiting=timed_notice,
        progress=terminal_progress,
    )


def note(given: Arguments, notice: str) -> None:
    """Print a note on standard error, once for each text; "" prints nothing."""
    if notice and notice not in vars(given).setdefault("noted", []):
        print(f"eomgen: note: {one_line(notice)}", file=sys.stderr)
        given.noted.append(notice)


def located(scene: str) -> AbstractContextManager[None]:
    """A context that starts the messages of errors with the name of the scene's file."""
    path = find_scene(scene)
    return Reporter(scene=path.name, text=lambda: scene_text(path)).located()


def assignments(
    texts: list[str], known: Sequence[str] | Mapping[str, float], option: str
) -> dict[str, float]:
    """The values, by name, of an option that is given as NAME=X.

    Raises `RunError` for an unknown name, or an X that is not a finite number.
    """
    what = {"--set": "parameter", "--state": "state"}[option]
    values = {}
    for text in texts:
        name, sign, number = text.partition("=")
        name = identifier(name)
        angle = number_with_unit(number) if option == "--state" else None
        if angle:
            number, name = str(angle[0]), f"{name}_deg" if angle[1] else name
        check_name(name, known, option, what)
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not (sign and math.isfinite(value)):
            raise RunError(f"{option} {text}: gives no finite number; write {option} {name}=1.5")
        values[name] = value + 0.0  # -0.0 becomes 0.0, as in a scene
    return values


def scene_with_inputs(given: Arguments) -> tuple[Scene, dict[str, Given]]:
    """The scene, and the inputs that `--input` gives."""
    scene = read_scene(given.scene)
    return scene, given_inputs(given.inputs, [i.name for i in all_inputs(scene)])


def given_inputs(texts: list[str], known: Sequence[str]) -> dict[str, Given]:
    """The inputs of `--input NAME=X`, where X is a number or a formula, and of `--input FILE`, of
    which the columns of the `known` inputs are taken.
    """
    found: dict[str, Given] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        if sign:
            found[name] = value
        else:
            found |= read_table(Path(text), known, Reporter(argument=as_flag))
    return found


def overlap_lines(model: Model) -> list[str]:
    """A line for each soft contact or stop that overlaps at the initial state."""
    return [
        f"{found.kind} '{found.effect}' starts {found.depth:.3g} {found.unit} deep, "
        f"with {found.energy:.3g} J stored in it"
        for found in overlaps_at_start(model)
    ]


def shortened(words: Sequence[str], most: int = FEW) -> list[str]:
    """The words; of more than `most` the first ones, how many are omitted, and the last."""
    if len(words) <= most:
        return list(words)
    first = min(most, 10)
    return [*words[:first], f"… {len(words) - first - 1} more …", words[-1]]


def print_listed(label: str, words: Sequence[str]) -> None:
    """Print words after a label, separated by commas, and break lines only between words."""
    # A no-break space keeps a word of several parts on one line.
    text = ", ".join(word.replace(" ", "\u00a0") for word in words) or "none"
    print_wrapped(label, text)


def print_wrapped(label: str, text: str) -> None:
    """Print a text after a label, wrapped at 100 columns and indented by the label's width."""
    lines = textwrap.wrap(
        text,
        100,
        initial_indent=label,
        subsequent_indent=" " * len(label),
        break_long_words=False,
        break_on_hyphens=False,
    )
    print("\n".join(lines).replace("\u00a0", " "))
