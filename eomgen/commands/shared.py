"""What commands share: a scene read and overridden, its code, assignments, short lists."""

import argparse
import math
import sys
import textwrap
from collections.abc import Collection, Sequence
from contextlib import AbstractContextManager

from eomgen.api.given import Outputs, check_outputs, overridden
from eomgen.api.reporter import Reporter
from eomgen.dynamics.diagnostics import initial_overlaps
from eomgen.errors import RunError, nearest
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model, dofs_of
from eomgen.run.progress import terminal_notice, terminal_progress
from eomgen.scene.effects import JointStop
from eomgen.scene.reader import find_scene, read_scene
from eomgen.scene.schema import Scene
from eomgen.text import one_line

Arguments = argparse.Namespace

OPTIONS = {
    "inputs": "--input",
    "motion": "--motion-time",
    "parameters": "--set",
    "resume": "--from",
}
"""What arguments are called on the command line, where that is not their name."""
FEW = 40
"""Lines or names of one kind up to which all are shown."""


def read_model(scene: str, given: Arguments) -> tuple[Model, str]:
    """A scene's model with what the command line overrides, and the name for files made of it."""
    return read_whole(scene, given)[1:]


def read_whole(scene: str, given: Arguments) -> tuple[Scene, Model, str]:
    """A scene, its model with what the command line overrides, and the name for files made of it.

    Files of another form or route than the scene's own are named after these, too. What was put
    right while reading is said on standard error.
    """
    asked = named_outputs(given)
    if asked is not None:
        check_outputs(asked, "--outputs")
    tables = read_scene(scene)
    with located(scene):
        model = elaborate(tables)
        name = model.name
        for notice in model.notices:
            print(f"eomgen: note: {find_scene(scene).name}: {notice}", file=sys.stderr)
        wanted = {option: getattr(given, option, None) for option in ("form", "route")}
        for option, value in wanted.items():
            if value not in (None, getattr(model, option)):
                name = f"{name}_{value}"
        model = overridden(model, **wanted, outputs=asked, place="--outputs")
    return tables, model, name


def named_outputs(given: Arguments) -> Outputs | None:
    """What `--outputs a,b,c` or `--outputs all` names; None without it."""
    text: str | None = getattr(given, "outputs", None)
    if text is None or text == "all":
        return "all" if text else None
    return [name.strip() for name in text.split(",")]


def required(given: Arguments, model: Model) -> Sequence[str]:
    """Outputs that the command line names one by one, and what these take."""
    return () if named_outputs(given) in (None, "all") else model.outputs


def reporter_of(given: Arguments, scene: str) -> Reporter:
    """The reporter of the command line for a scene."""
    return Reporter(
        scene=find_scene(scene).name,
        argument=lambda name: OPTIONS.get(name, f"--{name.replace('_', '-')}"),
        note=lambda notice: note(given, notice),
        trial=lambda text: print(f"    trying {text}", flush=True),
        waiting=terminal_notice,
        progress=terminal_progress,
    )


def note(given: Arguments, notice: str) -> None:
    """Print a note on standard error, once for each text; "" prints nothing."""
    if notice and notice not in vars(given).setdefault("noted", []):
        print(f"eomgen: note: {one_line(notice)}", file=sys.stderr)
        given.noted.append(notice)


def located(scene: str) -> AbstractContextManager[None]:
    """Name the scene's file in front of what is said of the scene."""
    return Reporter(scene=find_scene(scene).name).located()


def assignments(texts: list[str], known: Collection[str], option: str) -> dict[str, float]:
    """Numbers by name of an option that is given as NAME=X. Raises `RunError` for any other."""
    what = {"--set": "parameter", "--input": "input", "--state": "state"}[option]
    values = {}
    for text in texts:
        name, sign, number = text.partition("=")
        if name not in known:
            hint = nearest(name, known) or f"; known: {', '.join(known) or 'none'}"
            raise RunError(f"{option}: no {what} '{name}'{hint}")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not (sign and math.isfinite(value)):
            raise RunError(f"{option} {text}: gives no finite number; write {option} {name}=1.5")
        values[name] = value + 0.0  # -0.0 becomes 0.0, as in a scene
    return values


def overlap_lines(model: Model) -> list[str]:
    """A line for each soft contact or stop that is pressed in at the initial state.

    Such an effect starts with energy in it, and may throw the bodies apart.
    """
    lines = []
    effects = {effect.name: effect for effect in model.effects}
    joints = dofs_of(model.bodies, model.dimensions)
    for overlap in initial_overlaps(model):
        effect, kind, unit = effects[overlap.effect], "contact", "m"
        if isinstance(effect, JointStop):
            slides = {
                dof == "prismatic" for joint in effect.acted_on(joints) for dof in joints[joint]
            }
            kind = "stop"
            unit = "rad or m" if len(slides) == 2 else "m" if True in slides else "rad"
        lines.append(
            f"{kind} '{overlap.effect}' starts {overlap.depth:.3g} {unit} deep, "
            f"with {overlap.energy:.3g} J in it"
        )
    return lines


def shortened(words: Sequence[str], most: int = FEW) -> list[str]:
    """The words, or of many the first, how many there are between, and the last."""
    if len(words) <= most:
        return list(words)
    first = min(most, 10)
    return [*words[:first], f"… {len(words) - first - 1} more …", words[-1]]


def print_listed(label: str, words: Sequence[str]) -> None:
    """Print words after a label, in lines that break between words only."""
    # A no-break space within a word keeps it whole.
    text = ", ".join(word.replace(" ", "\u00a0") for word in words) or "none"
    print_wrapped(label, text)


def print_wrapped(label: str, text: str) -> None:
    """Print a text after a label, in lines of at most 100 columns."""
    lines = textwrap.wrap(
        text,
        100,
        initial_indent=label,
        subsequent_indent=" " * len(label),
        break_long_words=False,
        break_on_hyphens=False,
    )
    print("\n".join(lines).replace("\u00a0", " "))
