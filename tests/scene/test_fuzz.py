"""Whatever a scene's text is, a message or a model comes of it: no crash, no hang, nothing run."""

from collections.abc import Callable
from pathlib import Path

import fuzzing
import hostile
import pytest
from campaign import some
from fuzzing import Failure, outcome, tried

from eomgen.base.errors import SceneError
from eomgen.scene.reader import find_scene


def test_scenes_with_something_wrong() -> None:
    """The campaign of `tests/campaigns/fuzz_scenes.py`, its first part."""
    counts, _, failures = tried(range(some(300, 100_000)))
    assert not failures
    assert counts["message"] > counts["model"] > some(7, 3000)


@pytest.mark.parametrize(
    ("kind", "count"),
    [(hostile.SCENES, some(30, 50_000)), (hostile.ARCHIVES, some(30, 20_000))],
)
def test_hostile_files(tmp_path: Path, kind: str, count: int) -> None:
    """The campaign of `tests/campaigns/fuzz_files.py`, its first part."""
    counts, failures = hostile.tried(kind, range(count), tmp_path)
    assert not failures
    assert counts["refused"] > counts["taken"] > count // 50


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
    monkeypatch.setattr(fuzzing, "elaborate", fault)
    with pytest.raises(Failure):
        outcome(find_scene("pendulum").read_text())


def _prints(command: object) -> int:
    print("\x1b[31mred")
    return 0


def _says_nothing(command: object) -> int:
    return 1


def _takes_memory(command: object) -> int:
    return 0 * len(b"\1" * (hostile.MOST_MEMORY * 1200))


@pytest.mark.parametrize("fault", [_crashes, _hangs, _prints, _says_nothing, _takes_memory])
def test_faults_of_files_are_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: Callable[[object], int]
) -> None:
    """This campaign can fail, too."""
    monkeypatch.setattr(hostile, "HANGS", 0.1)
    monkeypatch.setattr(hostile, "main", fault)
    with pytest.raises(Failure):
        hostile.outcome(hostile.SCENES, 0, tmp_path)
