"""Files, names and texts of others are read within bounds, and never shown as they are."""

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from eomgen.cli import main
from eomgen.errors import RunError, SceneError
from eomgen.files import read_plain


@pytest.fixture
def strange(tmp_path: Path) -> Iterator[dict[str, Path]]:
    """Things with a name that are no plain files."""
    things = {name: tmp_path / name for name in ("pipe", "socket", "folder", "device", "endless")}
    os.mkfifo(things["pipe"])
    things["folder"].mkdir()
    things["device"].symlink_to("/dev/null")
    things["endless"].symlink_to("/dev/zero")
    with socket.socket(socket.AF_UNIX) as heard:
        heard.bind(str(things["socket"]))
        yield things


def test_only_plain_files_are_read(strange: dict[str, Path]) -> None:
    """Nothing waits for a pipe's other end, and nothing endless is read."""
    for path in strange.values():
        with pytest.raises(RunError, match="no plain file; save what it holds to a file"):
            read_plain(path, 10)


def test_a_file_is_read_up_to_a_size(tmp_path: Path) -> None:
    """Exactly as much is right; one byte more, or a hole of a terabyte, is too much."""
    path = tmp_path / "data"
    path.write_bytes(b"x" * 10)
    assert read_plain(path, 10) == b"x" * 10
    with pytest.raises(SceneError, match=r"^it: is larger than 9 bytes$"):
        read_plain(path, 9, name="it", error=SceneError)
    os.truncate(path, 2**40)
    with pytest.raises(RunError, match="is larger than 1000000 bytes"):
        read_plain(path, 1_000_000)
    link = tmp_path / "link"
    link.symlink_to(path)
    os.truncate(path, 4)
    assert read_plain(link, 4) == b"xxxx"


def test_what_cannot_be_read_is_said(tmp_path: Path) -> None:
    """Missing files, and names that no file can have."""
    for name, why in (
        ("none", "No such file or directory"),
        ("nul\0", "embedded null byte"),
        ("n" * 300, "File name too long"),
    ):
        with pytest.raises(RunError, match=f"cannot be read: {why}"):
            read_plain(tmp_path / name, 10)


@pytest.mark.parametrize("kind", ["pipe", "socket", "device", "endless"])
def test_a_scene_is_a_plain_file(
    strange: dict[str, Path], capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    """`check <(command)` is told what to do instead of being waited for."""
    assert main(["check", str(strange[kind])]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"eomgen: {kind}: is a ") and "no plain file; save" in said
