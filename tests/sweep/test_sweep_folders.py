"""The folder of a sweep attacked: its results are right, or it is refused in a line."""

from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from campaign import counted, some
from folder_attacks import outcome

import eomgen
from eomgen.base.errors import RunError
from eomgen.sweep.cluster import run_for
from eomgen.sweep.members import Task


def test_attacked_folders(tmp_path: Path) -> None:
    """Flips, cuts, links, pipes, edits, left-overs: the first of a campaign."""
    counts, failures = counted(partial(outcome, tmp_path), range(some(30, 1000)))
    assert not failures, "\n".join(failures)
    assert len(counts) > 10


def test_versions_are_not_mixed(tmp_path: Path) -> None:
    """A sweep of another version does not go on, and a worker of another one refuses its task."""
    vary, asked = {"theta": [0.1, 0.2]}, dict[str, Any](t_end=0.1, backend="numpy")
    with patch("eomgen.api.sweeping.Task", partial(Task, by="eomgen 0.0.1")):
        eomgen.ensemble("pendulum", vary, folder=tmp_path / "kept", **asked)
    with pytest.raises(RunError, match=r"holds a sweep of another version, eomgen 0\.0\.1, and "):
        eomgen.ensemble("pendulum", vary, folder=tmp_path / "kept", **asked)
    with pytest.raises(RunError, match=r"a worker has eomgen .*, and this is eomgen 0\.0\.1; "):
        run_for("eomgen 0.0.1", b"", [[0.1]])
