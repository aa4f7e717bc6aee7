"""The folder of a sweep attacked: its results are right, or it is refused in a line."""

from pathlib import Path

from campaign import some
from folder_attacks import tried


def test_attacked_folders(tmp_path: Path) -> None:
    """Flips, cuts, links, pipes, edits, left-overs: the first of a campaign."""
    counts, failures = tried(range(some(30, 1000)), tmp_path)
    assert not failures, "\n".join(failures)
    assert len(counts) > 10
