"""The arguments of public functions: a scene, and values that replace the scene's own."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np

from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.base.displays import DISPLAYS
from eomgen.base.errors import RunError, SceneError, nearest
from eomgen.dynamics.start.assembly import assembled
from eomgen.dynamics.start.singularity import check_nonsingular
from eomgen.language.base import identifier
from eomgen.model.elaborate import available_in, elaborate, outputs_for
from eomgen.model.model import Model
from eomgen.scene.reader import find_scene, parse_scene, read_scene, read_tables, scene_text
from eomgen.scene.schema import Form, Route, Scene
from eomgen.tables.outputs import OUTPUTS

Source = str | PathLike[str] | Mapping[str, Any] | Scene
Values = Mapping[str, float]
Outputs = Literal["all"] | Sequence[str]


def read(source: Source) -> Scene:
    """Read a scene and check each table and key.

    source  a path; the name of a built-in scene; TOML text of several lines; a mapping with the
            content of a file, where numbers and arrays may be NumPy's; or a `Scene`

    Raises `SceneError` with a line for each mistake: location, value, remedy.
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
        f"a scene cannot be read from {type(source).__name__}; give a path, a name, a text, a "
        "mapping or a Scene"
    )


@public
def check(source: Source) -> Model:
    """Build the model of a scene: bodies in a tree, `coordinates`, `velocities`, `states`,
    `inputs`, `parameters`, and `notices` of corrected values.

    Raises `SceneError` if the scene describes no mechanism or its mass matrix is singular.
    """
    return model_of(read(source), source)


def _show_scene(scene: Scene) -> str:
    from eomgen.show.notebook import model_html, scene_html

    return scene_html(scene.name, scene.title, scene.about) + model_html(
        assembled(elaborate(scene))
    )


def _show_model(model: Model) -> str:
    from eomgen.show.notebook import model_html, scene_html

    return scene_html(model.name, model.title) + model_html(model)


DISPLAYS.update({"Scene": _show_scene, "Model": _show_model})


def model_of(scene: Scene, source: Source) -> Model:
    """The checked model of a scene that was read from `source`. If that is a file, errors state it
    and the line.
    """
    reporter = SILENT
    if isinstance(source, PathLike) or (isinstance(source, str) and "\n" not in source):
        path = find_scene(source) if isinstance(source, str) else Path(source)
        reporter = Reporter(scene=path.name, text=lambda: scene_text(path))
    with reporter.located():
        return checked(assembled(elaborate(scene)))


def checked(model: Model, reporter: Reporter = SILENT) -> Model:
    """The model itself. Raises `SceneError` if its mass matrix is singular."""
    with reporter.located():
        check_nonsingular(model)
    return model


def modelled(
    scene: Scene,
    *,
    form: Form | None = None,
    route: Route | None = None,
    outputs: Outputs | None = None,
    reporter: Reporter = SILENT,
) -> Model:
    """Build the model of a scene, report its notices, then apply `overridden`.

    The mass matrix is not checked. Raises `SceneError`.
    """
    with reporter.located():
        model = assembled(elaborate(scene))
        for notice in model.notices:
            reporter.note_scene(notice)
        return overridden(model, form=form, route=route, outputs=outputs, reporter=reporter)


def overridden(
    model: Model,
    *,
    form: Form | None = None,
    route: Route | None = None,
    outputs: Outputs | None = None,
    reporter: Reporter = SILENT,
) -> Model:
    """A model with another state form, route or set of outputs; None keeps the scene's.

    Raises `SceneError` for outputs that do not exist or do not fit the model.
    """
    model = replace(model, form=form or model.form, route=route or model.route)
    if outputs is None:
        return model
    check_outputs(outputs, reporter)
    argument = reporter.argument("outputs")
    chosen = outputs_for(outputs, argument, available_in(model))
    return replace(model, outputs=chosen)


def check_outputs(outputs: Outputs, reporter: Reporter = SILENT) -> None:
    """Raise `SceneError` for an unknown output, or one that every module has."""
    argument = reporter.argument("outputs")
    for name in () if outputs == "all" else outputs:
        if name in ("derivative", "jacobian"):
            raise SceneError(f"{argument}: '{name}' is always included; leave it out")
        if name not in OUTPUTS:
            hint = nearest(name, OUTPUTS) or f"; known: all, {', '.join(OUTPUTS)}"
            raise SceneError(f"{argument}: no output '{name}'{hint}")


def named(
    values: Values | None, known: Sequence[str] | Mapping[str, float], argument: str, what: str
) -> dict[str, float]:
    """The values as floats, by name.

    Raises `RunError`, which calls a value `what`, for an unknown name or a number that is not
    finite.
    """
    found = {}
    if not isinstance(values, Mapping | None):
        raise RunError(f"{argument}: {type(values).__name__} is no mapping; give values by name")
    for name, value in (values or {}).items():
        name = identifier(name)
        check_name(name, known, argument, what)
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = math.nan
        if not np.isfinite(number):
            raise RunError(f"{argument}: {name} is not a finite number")
        found[name] = number + 0.0  # -0.0 becomes 0.0, as in a scene
    return found


def check_name(
    name: str, known: Sequence[str] | Mapping[str, float], argument: str, what: str
) -> None:
    """Raise `RunError` unless a name is among those `known`."""
    if name not in known:
        hint = nearest(name, known) or f"; known: {', '.join(known) or 'none'}"
        raise RunError(f"{argument}: no {what} '{name}'{hint}")


def values_of(
    model: Model, parameters: Values | None, inputs: Values | None, reporter: Reporter = SILENT
) -> tuple[dict[str, float], dict[str, float]]:
    """Values of a model's parameters and constant values of its inputs, by name.

    Raises `RunError` as `named` does.
    """
    return (
        named(parameters, model.defaults, reporter.argument("parameters"), "parameter"),
        named(inputs, [i.name for i in model.inputs], reporter.argument("inputs"), "input"),
    )
