"""Loading of Python source that this program generated, as a module."""

import importlib.abc
import importlib.util
from types import CodeType, ModuleType


class _FromSource(importlib.abc.InspectLoader):
    """A loader for a module whose source is a string."""

    def __init__(self, source: str, code: CodeType | None) -> None:
        self._source, self._code = source, code

    def get_source(self, fullname: str) -> str:
        return self._source

    def get_code(self, fullname: str) -> CodeType | None:
        return self._code or super().get_code(fullname)


def load_source(source: str, name: str, code: CodeType | None = None) -> ModuleType:
    """A module with this name from source; `code` is the same compiled, if it is at hand.
    Exceptions that the source raises are not caught.
    """
    spec = importlib.util.spec_from_loader(name, _FromSource(source, code))
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
