"""Fixtures shared by the tests."""

from collections.abc import Iterator

import pytest
from mechanisms import BUILT_IN, Compiled, compiled


@pytest.fixture(scope="session", params=BUILT_IN)
def built_in(request: pytest.FixtureRequest) -> Compiled:
    """Each built-in scene, compiled once."""
    return compiled(request.param)


@pytest.fixture(scope="session", autouse=True)
def _own_store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Generated code of the tests is kept apart from the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("EOMGEN_CACHE", str(tmp_path_factory.mktemp("store")))
        yield
