"""Python source that this program wrote itself, loaded as a module."""

import importlib.abc
import importlib.util
from types import ModuleType


class _FromSource(importlib.abc.InspectLoader):
    """Loads a module from source that is at hand."""

    def __init__(self, source: str) -> None:
        self._source = source

    def get_source(self, fullname: str) -> str:
        return self._source


def load_source(source: str, name: str) -> ModuleType:
    """A module of this name made from source. What the source raises is raised here."""
    spec = importlib.util.spec_from_loader(name, _FromSource(source))
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
