"""Whatever a scene's text is, a message or a model comes of it: no crash, no hang, nothing run."""

from functools import partial
from pathlib import Path

import fuzzing
import hostile
import pytest
from campaign import counted, some


def test_scenes_with_something_wrong() -> None:
    """The first of `tests/campaigns/by_number.py scenes`."""
    counts, failures = counted(fuzzing.outcome, range(some(150, 100_000)))
    assert not failures
    assert counts["message"] > counts["model"] > some(3, 3000)


@pytest.mark.parametrize(
    ("kind", "count"), [(hostile.SCENES, some(30, 50_000)), (hostile.ARCHIVES, some(30, 20_000))]
)
def test_hostile_files(tmp_path: Path, kind: str, count: int) -> None:
    """The first of `tests/campaigns/by_number.py files` and of its `archives`."""
    counts, failures = counted(partial(hostile.outcome, kind, tmp_path), range(count))
    assert not failures
    assert counts["refused"] > counts["taken"] > count // 50
