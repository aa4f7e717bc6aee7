"""Fixtures shared by the tests."""

import pytest
from mechanisms import BUILT_IN, Compiled, compiled


@pytest.fixture(scope="session", params=BUILT_IN)
def built_in(request: pytest.FixtureRequest) -> Compiled:
    """Each built-in scene, compiled once."""
    return compiled(request.param)
