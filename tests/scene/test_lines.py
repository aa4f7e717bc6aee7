"""The lines of a scene's file in messages."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

import eomgen
from eomgen.commands.main import main
from eomgen.scene.built_in import BUILT_IN
from eomgen.scene.lines import line_of, lines_of, with_lines

TRICKY = '''\
# a comment [not.a.table]
name = "x # [y]"   # another
title = """
[[bodies]]
a = 1 \\""" quote""""
path = 'C:\\' # literal
"odd.key" = 1
a.b . c = 2

[[bodies]] # the first
name = "one"
shapes = [
    # in between
    { type = "disc", center = [0, # here
        1] },
    { type = "rod", size = { x = 1, "y z" = "}]" } },
]
[bodies.extra]
k = 1
[[bodies.parts]]
n = 1
[[bodies.parts]]
n = 2
[[ bodies ]]
name = \'\'\'
two]\'\'\'
[[bodies.parts]]
n = 3

[parameters]
m={value=1,unit="kg"}
'''


def leaves(value: Any, location: str = "") -> list[str]:
    """The locations of all that a text holds, as messages write them."""
    found = [location] if location else []
    if isinstance(value, dict):
        for key, part in value.items():
            found += leaves(part, f"{location}.{key}".lstrip("."))
    elif isinstance(value, list):
        for i, part in enumerate(value):
            found += leaves(part, f"{location}[{i}]")
    return found


SCENES = [TRICKY, *(path.read_text("utf-8") for path in sorted(BUILT_IN.glob("*.toml")))]


@pytest.mark.every(3)
@pytest.mark.parametrize("text", SCENES, ids=range(len(SCENES)))
def test_each_location_is_where_the_parser_meets_it(text: str) -> None:
    """Judged by `tomllib`: a location is in no valid beginning of the text that ends before its
    line, and in the first that ends at its line or after.
    """
    lines = lines_of(text)
    assert sorted(lines) == sorted(leaves(tomllib.loads(text)))
    rows, known, ended = text.split("\n"), set[str](), 0
    for k in range(1, len(rows) + 1):
        if len(rows) > 150 and k % 7 and k < len(rows):
            continue  # of a long text some beginnings
        try:
            found = set(leaves(tomllib.loads("\n".join(rows[:k]))))
        except tomllib.TOMLDecodeError:
            continue
        assert all(ended < lines[location] <= k for location in found - known)
        known, ended = found, k


def test_lines_within_a_value() -> None:
    """Entries of lists over several lines, tables in one line; what is missing is in its table."""
    lines = lines_of(TRICKY)
    for location, line in {
        "title": 3,
        "odd.key": 7,
        "a.b.c": 8,
        "bodies[0].shapes[0].center": 14,
        "bodies[0].shapes[0].center[1]": 15,
        "bodies[0].shapes[1].size.y z": 16,
        "bodies[0].parts[1].n": 23,
        "bodies[1]": 24,
        "bodies[1].parts[0].n": 28,
        "bodies[1].mass": 24,
        "parameters.m.unit": 31,
        "nowhere.x": 0,
    }.items():
        assert line_of(location, lines) == line, location
    said = ["s.toml: bodies[1].mass: missing", "s.toml: and 3 more", "other: name: wrong"]
    assert list(with_lines(said, "s.toml", TRICKY)) == [
        "s.toml:24: bodies[1].mass: missing",
        *said[1:],
    ]


def test_a_broken_text_has_lines_up_to_its_mistake(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The message about the syntax itself starts with its line."""
    assert lines_of('a = 1\nb = [1,\n"') == {"a": 1, "b": 2, "b[0]": 2, "b[1]": 3}
    assert lines_of("[" * 5000) == {}
    scene = tmp_path / "broken.toml"
    scene.write_text('name = "broken"\n\nmass 3\n')
    assert main(["check", str(scene)]) == 1
    assert capsys.readouterr().err.startswith("eomgen: broken.toml:3: is not TOML: ")


def test_functions_name_the_file_and_the_line(tmp_path: Path) -> None:
    """Of what is wrong with the tables, and of what is wrong with the mechanism."""
    scene = tmp_path / "two.toml"
    good = (BUILT_IN / "pendulum.toml").read_text("utf-8")
    for old, new, location in (
        ('type = "revolute"', 'type = "revolut"', r"joints\[0\]\.type"),
        ('parent = "world"', 'parent = "earth"', r"joints\[0\]\.parent"),
    ):
        text = good.replace(old, new, 1)
        line = text[: text.index(new)].count("\n") + 1
        scene.write_text(text)
        for function in (eomgen.check, eomgen.simulate, eomgen.verify, eomgen.generate):
            with pytest.raises(eomgen.SceneError, match=rf"^two\.toml:{line}: {location}: "):
                function(scene)
