"""Whatever a scene's text is, a message or a model comes of it: no crash, no hang, nothing run."""

from pathlib import Path

import hostile
import pytest
from campaign import some
from fuzzing import tried


def test_scenes_with_something_wrong() -> None:
    """The campaign of `tests/campaigns/fuzz_scenes.py`, its first part."""
    counts, _, failures = tried(range(some(150, 100_000)))
    assert not failures
    assert counts["message"] > counts["model"] > some(3, 3000)


@pytest.mark.parametrize(
    ("kind", "count"), [(hostile.SCENES, some(30, 50_000)), (hostile.ARCHIVES, some(30, 20_000))]
)
def test_hostile_files(tmp_path: Path, kind: str, count: int) -> None:
    """The campaign of `tests/campaigns/fuzz_files.py`, its first part."""
    counts, failures = hostile.tried(kind, range(count), tmp_path)
    assert not failures
    assert counts["refused"] > counts["taken"] > count // 50
