"""Files, names and texts of others are read within bounds, and never shown as they are."""

import io
import os
import pickle
import re
import socket
import sys
import tracemalloc
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from campaign import some

from eomgen.base.errors import RunError, SceneError
from eomgen.base.files import read_plain
from eomgen.base.streams import steady_streams
from eomgen.base.text import LONGEST_LINE
from eomgen.commands.main import main
from eomgen.run.module import load_module
from eomgen.run.progress import terminal_progress
from eomgen.run.trajectory import load_npz
from eomgen.scene.reader import BUILT_IN


@pytest.fixture
def strange(tmp_path: Path) -> Iterator[dict[str, Path]]:
    """Things with a name that are not plain files."""
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
        with pytest.raises(RunError, match="not a plain file; save its content to a file"):
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
    """`check <(command)` is refused with a remedy instead of being waited for."""
    assert main(["check", str(strange[kind])]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"eomgen: {kind}: is a ") and "not a plain file; save" in said


@pytest.mark.parametrize("kind", ["pipe", "socket", "device", "endless", "folder"])
@pytest.mark.parametrize(
    ("command", "place"),
    [
        ("simulate pendulum -o {out} --from {place}", "run.npz"),
        ("generate pendulum -o {out}", "pendulum.py"),
        ("generate pendulum -o {out} --check", "pendulum.py"),
        ("simulate pendulum --t-end 0.1 -o {out}", "pendulum.csv"),
        ("simulate pendulum --t-end 0.1 -o {out} --force", "pendulum.npz"),
        ("derive pendulum -o {place}", "derivation.txt"),
        ("linearise pendulum -o {place}", "matrices.npz"),
    ],
)
def test_no_command_waits_for_a_file(
    strange: dict[str, Path], capsys: pytest.CaptureFixture[str],
    kind: str, command: str, place: str,
) -> None:  # fmt: skip
    """What is there under a name that a command reads or writes is asked for its kind first."""
    out = strange[kind].parent / "out"
    out.mkdir()
    strange[kind].rename(out / place)
    assert main([word.format(out=out, place=out / place) for word in command.split()]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"eomgen: {out / place}: is ")
    assert [path.name for path in out.iterdir()] == [place]


@pytest.fixture(scope="module")
def members(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """The arrays that a run leaves."""
    out = tmp_path_factory.mktemp("run")
    assert main(["simulate", "pendulum", "--t-end", "0.1", "-o", str(out)]) == 0
    with np.load(out / "pendulum.npz") as archive:
        return dict(archive)


@pytest.mark.parametrize("attack", ["packed", "nothing many times"])
def test_a_small_archive_does_not_become_large(
    members: dict[str, np.ndarray], tmp_path: Path, capsys: pytest.CaptureFixture[str], attack: str
) -> None:
    """Zeros that are packed would take a thousand times its size, and a list of entries that have
    no bytes as much as one likes.
    """
    path = tmp_path / "run.npz"
    if attack == "packed":
        zeros = np.zeros((1_000_000, 2))
        np.savez_compressed(path, **{**members, "t": np.arange(1_000_000.0) * 0, "y": zeros})
    else:
        states = np.ndarray(5_000_000, np.dtype("<U0"))
        with zipfile.ZipFile(path, "w") as archive:
            for name, array in {**members, "states": states}.items():
                with archive.open(f"{name}.npy", "w") as file:
                    np.lib.format.write_array(file, array)
    size = path.stat().st_size
    tracemalloc.start()
    try:
        with pytest.raises(RunError, match="is damaged") as caught:
            load_npz(path)
        assert tracemalloc.get_traced_memory()[1] < 4 * size + 2_000_000
    finally:
        tracemalloc.stop()
    command = ["simulate", "pendulum", "--t-end", "0.2", "-o", str(tmp_path), "--from", str(path)]
    assert main(command) == 1
    assert capsys.readouterr().err == f"eomgen: {caught.value}\n"


HOSTILE = "\x1b[31mred\x1b]0;t\x07\x9b2J\neomgen: all is well\u2028forged\u202egnp\u200b"
"""What a terminal would obey, a line that is forged, and an order of letters turned around."""
LONG = "k" * 100_000


def quoted(text: str) -> str:
    """A text in TOML."""
    return '"' + "".join(f"\\u{ord(c):04x}" if not c.isalnum() else c for c in text) + '"'


def places(text: str) -> Iterator[tuple[int, int]]:
    """Where in a scene keys and texts are."""
    for found in re.finditer(r'"[^"\n]*"|(?m:^)[a-z_]+(?= =)|(?<=[{,] )[a-z_]+(?= =)', text):
        yield found.span()


@pytest.mark.every(2)
@pytest.mark.parametrize("hostile", [HOSTILE, LONG], ids=["hostile", "long"])
def test_text_of_a_scene_is_never_shown_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], hostile: str
) -> None:
    """At every place of a scene where a text or a key may stand: one line a message, all of it to
    be seen, and not too long.
    """
    scene = tmp_path / "scene.toml"
    text = (BUILT_IN / "cart_pole.toml").read_text("utf-8")
    refused, put = 0, quoted(hostile)
    for begin, end in [*places(text)][:: some(2, 1)]:
        scene.write_text(text[:begin] + put + text[end:], "utf-8")
        refused += main(["check", str(scene)])
        said = capsys.readouterr()
        lines = [*said.out.splitlines(), *said.err.splitlines()]
        for line in (*said.out.split("\n"), *said.err.split("\n")):
            assert line.isprintable() and len(line) <= LONGEST_LINE + 20
        assert "eomgen: all is well" not in lines
        assert all(
            re.match(r"eomgen: scene\.toml(:\d+)?: ", line) for line in said.err.splitlines()
        )
    assert refused > some(15, 30)


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "command",
    [
        "simulate pendulum --set {}=1", "simulate pendulum --set gravity_g={}",
        "simulate pendulum --input {}", "simulate pendulum --outputs {}",
        "simulate pendulum --integrator {}", "simulate pendulum --budget {}",
        "simulate pendulum --dt {}", "simulate pendulum --form {}", "simulate pendulum --plot {}",
        "simulate pendulum -o {}", "simulate pendulum --from {}",
        "linearise cart_pole --state {}=1", "linearise cart_pole --hold {}",
        "linearise cart_pole --trim {}", "linearise cart_pole -o {}",
        "accuracy pendulum --methods {}", "accuracy pendulum --seed {}", "reference {}", "check {}",
        "check pendulum {}", "check pendulum --{}", "{}",
    ],
)  # fmt: skip
@pytest.mark.parametrize("hostile", [HOSTILE, LONG, "9" * 5000, "\udcff\udcfe.toml"], ids=range(4))
def test_what_the_command_line_gives_is_never_shown_as_it_is(
    command: str, hostile: str, capsys: pytest.CaptureFixture[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Names, values and files of an option, in one line, at fault or wrong usage."""
    monkeypatch.chdir(tmp_path)
    words = [word.format(hostile) for word in command.split()]
    try:
        code = main(words)
    except SystemExit as stop:
        code = int(stop.code or 0)
    said = capsys.readouterr()
    if code:
        assert code in (1, 2)
        *usage, line = said.err.splitlines()
        assert line.startswith("eomgen") and (code == 2 or not usage)
        assert len(line) <= LONGEST_LINE + 40 and "Traceback" not in said.err
    for line in (said.out + said.err).split("\n"):
        assert line.isprintable()


TITLE = (
    r"""$\frac{x_{ \\ ''' "" \end{document} %s {{ 7*7 }} {% raw %} & #$^~ ]]> \u2028 """
    "</script><script>alert(1)</script> <!--"
)


def test_a_title_is_text_wherever_it_lands(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In a docstring, a page, a figure, LaTeX, a table: shown, never obeyed."""
    scene = tmp_path / "titled.toml"
    text = (BUILT_IN / "pendulum.toml").read_text("utf-8")
    scene.write_text(text.replace('"Simple pendulum"', quoted(TITLE)), "utf-8")
    out = tmp_path / "out"
    assert main(["simulate", str(scene), "--t-end", "0.1", "-o", str(out)]) == 0
    capsys.readouterr()
    module = load_module((out / "pendulum.py").read_text("utf-8"))
    shown = TITLE.replace("\\", "/").replace('"', "'")
    assert (module.__doc__ or "").splitlines()[0] == shown
    page = (out / "pendulum.html").read_text("utf-8")
    assert "<script>alert" not in page and "{{ 7*7 }} {% raw %} &amp; #$^~ ]]&gt;" in page
    for form in ("text", "latex", "html"):
        assert main(["derive", str(scene), "--format", form]) == 0
        output = capsys.readouterr().out
        assert "<script>alert" not in output or form != "html"
        if form == "latex":
            begun = output.index(r"\begin{document}")
            assert (
                output.count(r"\end{document}") == 1
                and r"\frac{x\_" not in output[begun : begun + 80]
            )
            assert r"\$\textbackslash{}frac\{x\_\{" in output


def test_a_name_with_control_characters_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also of a file that is there: what is printed of it could not be distinguished from other
    lines.
    """
    scene = tmp_path / "a\nb.toml"
    scene.write_text((BUILT_IN / "pendulum.toml").read_text("utf-8"), "utf-8")
    assert main(["check", str(scene)]) == 1
    assert capsys.readouterr().err.endswith(
        r"a\nb.toml: has a control character in its name; rename it" + "\n"
    )
    for option in (["-o", str(tmp_path / "a\nb")], ["--plot", "a\x9b.png"], ["--from", "\u2028"]):
        with pytest.raises(SystemExit) as stop:
            main(["simulate", "pendulum", "--t-end", "0.1", *option])
        assert stop.value.code == 2
        assert "has a control character in its name" in capsys.readouterr().err
    odd = tmp_path / "pendül \u202e\udcff.toml"  # and others are no fault
    odd.write_bytes(scene.read_bytes())
    with steady_streams():
        assert main(["check", str(odd)]) == 0


def test_a_store_with_a_hostile_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What the environment says is text of others, too."""
    (tmp_path / "file").write_bytes(b"")
    monkeypatch.setenv("EOMGEN_CACHE", f"{tmp_path}/file/{HOSTILE}")
    assert main(["generate", "pendulum", "-o", str(tmp_path)]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("eomgen: note: the store ") and line.isprintable()


@pytest.mark.parametrize("columns", ["", "x", "0", "-3", "1", "2", "9" * 12, "9" * 5000])
def test_any_width_of_the_terminal(columns: str) -> None:
    """COLUMNS may say anything. It is put back before pytest, which fills lines, says more."""
    stream = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", columns)
        patch.setattr(stream, "isatty", lambda: True)
        patch.setattr(sys, "stderr", stream)
        with terminal_progress("label") as progress:
            progress(0.5)
        with pytest.raises(SystemExit):
            main(["--help"])
    assert 2 < len(stream.getvalue()) < 3000 or columns in ("1", "2")


def test_messages_stay_lines() -> None:
    """Lines that an error is given are its own; a break within one is not."""
    error = SceneError("a: first\neomgen: forged", "b: second")
    assert error.lines == (r"a: first\neomgen: forged", "b: second")
    assert str(error) == "\n".join(error.lines)
    assert pickle.loads(pickle.dumps(error)).lines == error.lines
    long = SceneError("place: " + "x" * 10_000 + " " + "y " * 10_000 + "; the remedy")
    assert len(str(long)) <= LONGEST_LINE and str(long).endswith("; the remedy")
    assert str(long).startswith("place: xxx") and "x…x" in str(long)
