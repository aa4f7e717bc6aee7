"""Tables of scenes as functions: the scene of a file, the same mistakes, and a stub for types."""

import tomllib

import pytest

import eomgen
from eomgen import entries
from eomgen.scene.built_in import BUILT_IN
from eomgen.scene.entries import tables

LISTS = {"bodies": "Body", "chains": "Chain", "points": "Point"}


@pytest.mark.parametrize("name", ["two_body", "ragdoll", "stiff_beam", "car_suspension"])
def test_the_scene_of_a_file(name: str) -> None:
    """All tables made one by one."""
    file = tomllib.loads((BUILT_IN / f"{name}.toml").read_text("utf-8"))
    for key, rows in file.items():
        if key in LISTS or key in ("joints", "effects", "constraints"):
            file[key] = [_made(LISTS.get(key), dict(row)) for row in rows]
    scene = entries.Scene(**{"name": name, **file})
    assert scene == eomgen.read(name) and isinstance(scene, eomgen.Scene)


def _made(name: str | None, row: dict[str, object]) -> object:
    """The table of a row, by the function of its type if it has one."""
    name = name or str(row.pop("type")).title().replace("_", "")
    return getattr(entries, name)(**row)


def test_all_tables_have_functions() -> None:
    """With help and arguments by name; what is no table is none."""
    assert {"Body", "Revolute", "Gravity", "Distance", "Rod", "Scene"} <= set(dir(entries))
    for name in tables():
        assert getattr(entries, name).__doc__, name
    with pytest.raises(AttributeError, match="Revolut'"):
        entries.Revolut  # type: ignore[attr-defined]  # noqa: B018


def test_mistakes_are_said_at_once() -> None:
    """By the table and its key."""
    with pytest.raises(eomgen.SceneError, match=r"Body: mas: unknown key \(did you mean 'mass'"):
        entries.Body(name="a", mas=1)  # type: ignore[call-arg]
    with pytest.raises(eomgen.SceneError, match="Revolute: child: missing"):
        entries.Revolute(name="pin", parent="world")  # type: ignore[call-arg]
