"""Values that do not change: their arrays and dictionaries do not either."""

from dataclasses import fields
from typing import Any


class FrozenDict(dict[Any, Any]):
    """A dictionary that does not change, of a value that does not."""

    def _refuse(self, *_: Any, **named: Any) -> Any:
        raise TypeError("these values are frozen; make a copy with dict(…) and change that")

    __setitem__ = __delitem__ = __ior__ = update = pop = popitem = clear = setdefault = _refuse

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(frozenset(self.items()))

    def __reduce__(self) -> tuple[type, tuple[dict[Any, Any]]]:
        return type(self), (dict(self),)


class Frozen:
    """A frozen dataclass whose arrays are read-only and whose dictionaries are frozen."""

    def __post_init__(self) -> None:
        for each in fields(self):  # type: ignore[arg-type]
            value = getattr(self, each.name)
            if isinstance(value, dict):
                object.__setattr__(self, each.name, FrozenDict(value))
            for part in value if isinstance(value, tuple) else (value,):
                if hasattr(part, "setflags"):
                    part.setflags(write=False)
