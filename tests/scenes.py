"""Small scenes as text: effects, and bodies for them to act on."""

import json
from collections.abc import Callable, Mapping
from typing import Any

import pytest

from eomgen.base.errors import SceneError
from eomgen.model.elaborate import elaborate
from eomgen.scene.reader import parse_scene

OF_BODIES = ("mass", "inertia_com", "com", "shapes")
OF_SCENES = (
    *("name", "title", "about", "dimensions", "outputs", "route", "form", "inputs", "parameters"),
    *("definitions", "points", "constraints", "initial", "simulation"),
)


def toml(value: Any) -> str:
    """A value as a scene has it."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key} = {toml(x)}' for key, x in value.items())} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml, value))}]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | bool) else repr(value)


def lines(table: Mapping[str, Any]) -> str:
    """A key a line."""
    return "".join(f"{key} = {toml(value)}\n" for key, value in table.items())


def effect(kind: str, /, *more: str, name: str = "e", **keys: Any) -> str:
    """An effect's table; `more` are lines of it."""
    table = lines({"type": kind, "name": name, **keys})
    return f"[[effects]]\n{table}" + "".join(f"{line}\n" for line in more)


WEIGHT = effect("gravity", name="gravity", g=9.81)


def free(
    *names: str,
    mass: float | Mapping[str, float] = 1.0,
    inertia_com: Any = 0.1,
    dimensions: int = 2,
    **keys: Any,
) -> str:
    """Bodies that nothing holds; one number is the moment of inertia about all axes. `keys` are the
    scene's.
    """
    masses = mass if isinstance(mass, Mapping) else dict.fromkeys(names, mass)
    inertia = _inertia(inertia_com, dimensions)
    bodies = [{"name": name, "mass": masses[name], "inertia_com": inertia} for name in names]
    joints = [{"name": f"{name}_free", "type": "free", "child": name} for name in names]
    top = {"name": "flight", "dimensions": dimensions, **keys, "bodies": bodies, "joints": joints}
    return lines(top)


def _inertia(value: Any, dimensions: int) -> Any:
    return [value] * 3 if dimensions == 3 and value and not isinstance(value, list) else value


def lone(joint: str, /, *tables: str, body: str = "b", on: str = "j", **keys: Any) -> str:
    """A scene of one body, held by a joint `on` of some type, and tables of effects and others.

    `keys` are those of the body, of the scene and of the joint; one number is the moment of inertia
    about all axes.
    """
    top = {"name": "lone", **{key: keys.pop(key) for key in OF_SCENES if key in keys}}
    own = {"mass": 1.0, **{key: keys.pop(key) for key in OF_BODIES if key in keys}}
    own["inertia_com"] = _inertia(own.get("inertia_com", 0.1), top.get("dimensions", 2))
    top["bodies"] = [{"name": body, **own}]
    top["joints"] = [{"name": on, "type": joint, "parent": "world", "child": body, **keys}]
    return lines(top) + "".join(tables)


def refusal(scene: str | Callable[[], object]) -> str:
    """The one line that a scene is refused with, or what is done with one."""
    with pytest.raises(SceneError) as error:
        elaborate(parse_scene(scene)) if isinstance(scene, str) else scene()
    message = str(error.value).removeprefix("scene: ")
    assert "\n" not in message and message.isprintable(), message
    return message
