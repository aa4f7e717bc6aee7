"""What commands share: a scene read and overridden, its code, assignments, short lists."""

import argparse
import math
import sys
import textwrap
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Literal

from eomgen.dynamics.finite import initial_overlaps
from eomgen.errors import EomgenError, RunError, SceneError, nearest
from eomgen.model.elaborate import elaborate, outputs_for
from eomgen.model.model import Model, ways_of
from eomgen.outputs import OUTPUTS
from eomgen.run.module import GeneratedModule, load_module
from eomgen.run.progress import terminal_notice
from eomgen.scene.effects import JointStop
from eomgen.scene.reader import find_scene, read_scene
from eomgen.scene.schema import Scene
from eomgen.store import Code, generated_code
from eomgen.study.diagnosis import problem_of
from eomgen.text import one_line

Arguments = argparse.Namespace

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
    asked = getattr(given, "outputs", None)
    names = () if asked is None else _output_names(asked)
    tables = read_scene(scene)
    with located(scene):
        model = elaborate(tables)
        name = model.name
        for notice in model.notices:
            print(f"eomgen: note: {find_scene(scene).name}: {notice}", file=sys.stderr)
        for option in ("form", "route"):
            wanted = getattr(given, option, None)
            if wanted not in (None, getattr(model, option)):
                model = replace(model, **{option: wanted})
                name = f"{name}_{wanted}"
        if asked is not None:
            chosen = outputs_for(
                names, "--outputs", model.points, model.inputs, model.parameters, model.driven
            )
            model = replace(model, outputs=chosen)
    return tables, model, name


def _output_names(text: str) -> Literal["all"] | Sequence[str]:
    """The names in `--outputs a,b,c`. Raises `RunError` for one that is none."""
    if text == "all":
        return "all"
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name in ("derivative", "jacobian"):
            raise RunError(f"--outputs: '{name}' is always there; leave it out")
        if name not in OUTPUTS:
            hint = nearest(name, OUTPUTS) or f"; known: all, {', '.join(OUTPUTS)}"
            raise RunError(f"--outputs: no output '{name}'{hint}")
    return names


def code_of(
    scene: str, model: Model, given: Arguments, *, anew: bool = False
) -> tuple[Code, GeneratedModule]:
    """A model's code, derived now or, unless `anew`, before, and its module, loaded and tried.

    Why the store was not used is said on standard error, once. Raises `SceneError` if it cannot be
    evaluated as the scene is, or has no output that the command line names.
    """
    with located(scene):
        with terminal_notice(f"deriving {model.name} …"):
            code = generated_code(model, anew=anew)
        note(given, code.notice)
        for notice in code.notices:
            note(given, f"{find_scene(scene).name}: {notice}")
        module = load_module(code.module, model.name)
        problem_of(module, model=model)
        if getattr(given, "outputs", None) not in (None, "all"):
            for name in model.outputs:
                if not hasattr(module, name):
                    raise RunError(f"--outputs: '{name}' is made for form = 'velocity' only")
    return code, module


def note(given: Arguments, notice: str) -> None:
    """Say on standard error what a command did without, if anything, once."""
    if notice and notice not in vars(given).setdefault("noted", []):
        print(f"eomgen: note: {one_line(notice)}", file=sys.stderr)
        given.noted.append(notice)


@contextmanager
def located(scene: str) -> Iterator[None]:
    """Name the scene's file in front of what is said of the scene."""
    try:
        yield
    except EomgenError as error:
        raise SceneError(*(f"{find_scene(scene).name}: {line}" for line in error.lines)) from None


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
    joints = ways_of(model.bodies, model.dimensions)
    for overlap in initial_overlaps(model):
        effect, kind, unit = effects[overlap.effect], "contact", "m"
        if isinstance(effect, JointStop):
            slides = {way == "slide" for joint in effect.acted_on(joints) for way in joints[joint]}
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
