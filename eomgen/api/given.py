"""What callers give: a scene, and what is to be other than it says."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np

from eomgen.dynamics.singularity import check_nonsingular
from eomgen.errors import RunError, SceneError, nearest
from eomgen.model.elaborate import elaborate, outputs_for
from eomgen.model.model import Model
from eomgen.outputs import OUTPUTS
from eomgen.scene.reader import parse_scene, read_scene, read_tables
from eomgen.scene.schema import Form, Route, Scene

Source = str | PathLike[str] | Mapping[str, Any] | Scene
Values = Mapping[str, float]
Outputs = Literal["all"] | Sequence[str]


def read(source: Source) -> Scene:
    """A scene, its tables and keys checked one by one.

    source  a path, or the name of a built-in scene; TOML text, which has several lines; a mapping
            of what a file would hold, in which NumPy's numbers and arrays may stand; or a `Scene`

    Raises `SceneError` with one line for each mistake: place, value, remedy.
    """
    if isinstance(source, Scene):
        return source
    if isinstance(source, str):
        return parse_scene(source) if "\n" in source else read_scene(source)
    if isinstance(source, PathLike):
        return read_scene(Path(source))
    if isinstance(source, Mapping):
        return read_tables(source)
    raise SceneError(
        f"a scene is no {type(source).__name__}; give a path, a name, a text, a mapping or a Scene"
    )


def check(source: Source) -> Model:
    """The mechanism that a scene describes: bodies in a tree, `coordinates`, `velocities`,
    `states`, `inputs` and `parameters`, with `notices` of what was put right.

    Raises `SceneError` where it makes no mechanism, or where its mass matrix is singular.
    """
    model = elaborate(read(source))
    check_nonsingular(model)
    return model


def overridden(
    model: Model,
    *,
    form: Form | None = None,
    route: Route | None = None,
    outputs: Outputs | None = None,
    place: str = "outputs",
) -> Model:
    """A model of another state form, route or outputs than its scene's; `place` is what messages
    call these. Raises `SceneError`.
    """
    model = replace(model, form=form or model.form, route=route or model.route)
    if outputs is None:
        return model
    check_outputs(outputs, place)
    chosen = outputs_for(outputs, place, model.points, model.inputs, model.parameters, model.driven)
    return replace(model, outputs=chosen)


def check_outputs(outputs: Outputs, place: str = "outputs") -> None:
    """Raise `SceneError` for an output that is none, or that every module has."""
    for name in () if outputs == "all" else outputs:
        if name in ("derivative", "jacobian"):
            raise SceneError(f"{place}: '{name}' is always there; leave it out")
        if name not in OUTPUTS:
            hint = nearest(name, OUTPUTS) or f"; known: all, {', '.join(OUTPUTS)}"
            raise SceneError(f"{place}: no output '{name}'{hint}")


def named(
    values: Values | None, known: Sequence[str] | Mapping[str, float], place: str, what: str
) -> dict[str, float]:
    """Finite numbers by names that are known. Raises `RunError` for others."""
    found = {}
    for name, value in (values or {}).items():
        if name not in known:
            hint = nearest(name, known) or f"; known: {', '.join(known) or 'none'}"
            raise RunError(f"{place}: no {what} '{name}'{hint}")
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = math.nan
        if not np.isfinite(number):
            raise RunError(f"{place}: {name} is no finite number")
        found[name] = number + 0.0  # -0.0 becomes 0.0, as in a scene
    return found


def check_time(value: float, argument: str) -> None:
    """Raise `RunError` unless a time, s, is positive and finite."""
    if not 0 < value < math.inf:
        raise RunError(f"{argument}: {value:g} is not a positive time; give one in s")
