"""Loading of Python source that this program generated, as a module."""

import importlib.abc
import importlib.util
from types import ModuleType


class _FromSource(importlib.abc.InspectLoader):
    """A loader for a module whose source is a string."""

    def __init__(self, source: str) -> None:
        self._source = source

    def get_source(self, fullname: str) -> str:
        return self._source


def load_source(source: str, name: str) -> ModuleType:
    """A module with this name from source. Exceptions that the source raises are not caught."""
    spec = importlib.util.spec_from_loader(name, _FromSource(source))
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
