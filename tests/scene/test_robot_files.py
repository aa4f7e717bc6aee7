"""Robot files: what they become, and what is said of those that are hostile or broken."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import robot_files
from campaign import some, thinned
from robot_files import KINDS, Kind

from eomgen.base.text import LONGEST_LINE
from eomgen.commands.main import main

MUTANTS = some(40, 5000)


pytestmark = pytest.mark.usefixtures("mujoco_in_this_process")


def outcome(
    kind: Kind, data: bytes, folder: Path, capsys: pytest.CaptureFixture[str]
) -> tuple[int, list[str]]:
    """The exit code of `check`, and the lines of its errors without notes."""
    path = folder / f"robot{kind.suffix}"
    path.write_bytes(data)
    code = main(["check", str(path)])
    lines = capsys.readouterr().err.splitlines()
    assert all(line.isprintable() and len(line) < LONGEST_LINE + 20 for line in lines)
    return code, [line for line in lines if not line.startswith("eomgen: note: ")]


def refused(kind: Kind, code: int, lines: list[str]) -> bool:
    """Whether a file was refused, in one line that names it, or else read without a line."""
    if code == 0:
        assert not lines
        return False
    assert code == 1 and len(lines) == 1, lines
    assert re.match(rf"eomgen: robot{kind.suffix}:", lines[0]), lines
    return True


def cases(kind: Kind) -> Iterator[tuple[bytes, str]]:
    """Files that are written by hand, with a part of the message, "" if they are read."""
    yield from robot_files.mistaken(kind)
    yield from robot_files.broken(kind)


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_each_mistake_has_one_clear_line(
    kind: Kind, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The message says what is wrong; what is no mistake is read."""
    for data, message in thinned(cases(kind), 3):
        code, lines = outcome(kind, data, tmp_path, capsys)
        assert refused(kind, code, lines) == bool(message), (data[:300], lines)
        assert not message or message in lines[0], lines


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_changed_files_are_refused_in_one_line_or_read(
    kind: Kind, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Seeded changes of values, attributes, elements, lines and bytes: some of both."""
    codes = []
    for number in range(MUTANTS):
        data = robot_files.mutant(kind, number)
        code, lines = outcome(kind, data, tmp_path, capsys)
        try:
            refused(kind, code, lines)
        except AssertionError:
            print(f"{kind.root} {number}: {lines}", file=sys.stderr)
            raise
        codes.append(code)
    assert 0.1 < np.mean(codes) < 0.9
