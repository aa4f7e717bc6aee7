"""Whatever a scene's text is, a message or a model comes of it: no crash, no hang, nothing run."""

from collections.abc import Callable

import fuzzing
import pytest
from campaign import some
from fuzzing import Failure, outcome, tried

from eomgen.errors import SceneError
from eomgen.scene.reader import find_scene


def test_scenes_with_something_wrong() -> None:
    """The campaign of `tests/campaigns/fuzz_scenes.py`, its first part."""
    counts, _, failures = tried(range(some(2000, 100_000)))
    assert not failures
    assert counts["message"] > counts["model"] > some(50, 3000)


def _crashes(scene: object) -> None:
    raise ZeroDivisionError


def _runs(scene: object) -> None:
    exec("pass")


def _hangs(scene: object) -> None:
    while True:
        pass


def _is_silent(scene: object) -> None:
    raise SceneError(" ")


@pytest.mark.parametrize("fault", [_crashes, _runs, _hangs, _is_silent])
def test_faults_are_noticed(
    monkeypatch: pytest.MonkeyPatch, fault: Callable[[object], None]
) -> None:
    """The campaign can fail."""
    tried(range(1))
    monkeypatch.setattr(fuzzing, "HANGS", 0.1)
    monkeypatch.setattr(fuzzing, "build_model", fault)
    with pytest.raises(Failure):
        outcome(find_scene("pendulum").read_text())
