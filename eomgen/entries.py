"""The tables of a scene as functions, with completion, help and types.

Their arguments are the keys of the reference: `Body` has those of a table in `bodies`, `Revolute`
those of a joint of that type. They return what a scene's file with these keys gives: it is frozen,
and may stand beside mappings. They raise `SceneError` with a line for each mistake. Tables that
other packages add are here, too.
"""

from typing import Any

from eomgen.scene.entries import maker, tables


def __getattr__(name: str) -> Any:
    made = maker(name)
    if made is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = made
    return made


def __dir__() -> list[str]:
    return list(tables())
