"""Standard streams that are closed, full, read by nobody or of ASCII; and Ctrl-C at any moment.

Real processes: what counts is the exit code, what is said, and which files are there.
"""

import io
import os
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from campaign import some

import eomgen.base.files
from eomgen.base.files import write_whole
from eomgen.base.streams import Steady, steady_streams
from eomgen.base.text import spelled
from eomgen.commands.main import main, parsers

EOMGEN = (sys.executable, "-m", "eomgen")
QUICK = "--no-arithmetic --quick --methods rk4 --t-end 0.1 --run-time 1"
TESTS = Path(__file__).parent.parent
COMMANDS = {
    "list": "list", "show": "show pendulum", "new": "new {out}/swing",
    "copy": "copy pendulum {out}/mine", "completion": "completion bash", "schema": "schema",
    "reference": "reference",
    "import": f"import {TESTS / 'arm.urdf'} -o {{out}}/arm.toml",
    "check": "check two_body", "derive": "derive two_body",
    "generate": "generate pendulum -o {out}",
    "export": "export pendulum --firmware -o {out}",
    "simulate": "simulate pendulum --t-end 0.1 -o {out}",
    "view": "view pendulum --t-end 0.1 -o {out}",
    "gallery": "gallery --scene pendulum --t-end 0.1 -o {out}",
    "verify": "verify pendulum --states 1",
    "accuracy": f"accuracy pendulum {QUICK} -o {{out}}",
    "effects": "effects pendulum --no-motion -o {out}",
    "fit": f"fit pendulum {TESTS / 'swing.csv'} --names gravity_g",
    "certify": "certify pendulum --t-end 0.1",
    "linearise": "linearise cart_pole",
    "plot": "plot pendulum --of theta,energy --t-end 0.1 -o {out}/p.pdf",
    "film": "film pendulum --t-end 0.1 -o {out}/f.gif",
    "sweep": "sweep pendulum --vary theta=1,2 --t-end 0.1 --workers 1 -o {out}",
}  # fmt: skip
QUICKER = [name for name in COMMANDS if name != "accuracy"]
WRITES = {
    "new": 1, "copy": 1, "import": 1, "generate": 1, "export": 3, "simulate": 5, "view": 5,
    "accuracy": 3, "plot": 1, "film": 1, "sweep": 3, "gallery": 2, "effects": 1,
}  # fmt: skip
FAULTS = {
    "full": ("> /dev/full", 1), "closed": (">&-", 0), "errors closed": ("2>&-", 0),
    "errors full": ("2> /dev/full", 0), "both closed": (">&- 2>&-", 0),
    "both full": ("> /dev/full 2>&1", 1), "input closed": ("<&-", 0),
}  # fmt: skip
"""What the shell does to the streams, and the exit code of a command that writes and goes well."""
FEW = (("check", "both full"), ("check", "errors closed"))


def environment(**changes: str) -> dict[str, str]:
    """The environment without a display and without wishes for Python, with what changes."""
    wishes = ("DISPLAY", "WAYLAND_DISPLAY", "PYTHONUNBUFFERED", "PYTHONIOENCODING", "PYTHONUTF8")
    return {**{k: v for k, v in os.environ.items() if k not in wishes}, **changes}


def run(
    command: str, out: Path, redirected: str = "", **changes: str
) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own, its streams as the shell leads them."""
    words = [word.format(out=out) for word in command.split()]
    return subprocess.run(
        ["sh", "-c", f'exec "$@" {redirected}', "sh", *EOMGEN, *words],
        check=False,
        capture_output=True,
        encoding="utf-8",
        env=environment(**changes),
        timeout=120,
    )


def quiet(done: subprocess.CompletedProcess[str]) -> bool:
    """Whether nothing was said that is not meant for people."""
    said = done.stdout + done.stderr
    return not any(word in said for word in ("Traceback", "Exception ignored", "Error:"))


def test_every_command_is_tried() -> None:
    """A new command is to join the table."""
    assert set(COMMANDS) == set(parsers()[1])


@pytest.mark.apart
@pytest.mark.parametrize(
    ("name", "fault"), some(FEW, [(name, fault) for name in COMMANDS for fault in FAULTS])
)
def test_streams_that_fail_end_no_command(tmp_path: Path, name: str, fault: str) -> None:
    """All files are written, what was lost is said where it can be, and the exit code is known."""
    redirected, code = FAULTS[fault]
    done = run(COMMANDS[name], tmp_path, redirected)
    assert done.returncode == code and quiet(done)
    if fault == "full":
        assert done.stderr.splitlines()[-1] == (
            "eomgen: standard output cannot be written: No space left on device"
        )
    assert len(list(tmp_path.iterdir())) == WRITES.get(name, 0)


@pytest.mark.parametrize("name", some(("check",), tuple(COMMANDS)))
def test_a_reader_that_has_enough_is_no_fault(tmp_path: Path, name: str) -> None:
    """As of `| head -1`, here one that is gone before anything is written."""
    theirs, ours = os.pipe()
    os.close(theirs)
    words = [word.format(out=tmp_path) for word in COMMANDS[name].split()]
    done = subprocess.run(
        [*EOMGEN, *words], check=False, stdout=ours, stderr=subprocess.PIPE, env=environment()
    )
    os.close(ours)
    assert (done.returncode, done.stderr) == (0, b"")
    assert len(list(tmp_path.iterdir())) == WRITES.get(name, 0)


@pytest.mark.parametrize("name", some(("reference",), tuple(COMMANDS)))
@pytest.mark.parametrize("how", some(("python",), ("python", "locale")))
def test_a_terminal_of_ascii(tmp_path: Path, name: str, how: str) -> None:
    """Everything is said in its letters: nothing is missing, nothing escaped."""
    ascii_alone = {
        "python": {"PYTHONIOENCODING": "ascii"},
        "locale": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    }[how]
    done = run(COMMANDS[name], tmp_path, **ascii_alone)
    assert done.returncode == 0 and quiet(done)
    assert done.stdout.isascii() and done.stderr.isascii()
    assert "\\u" not in done.stdout or name == "schema"  # as JSON spells it anywhere


@pytest.mark.parametrize("name", some(QUICKER[::2], list(COMMANDS)))
@pytest.mark.every(4)
def test_a_full_output_ends_no_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """Of each command: all its files, one line of what was lost, and 1."""
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert main([word.format(out=tmp_path) for word in COMMANDS[name].split()]) == 1
    said = capsys.readouterr().err.splitlines()
    assert said[-1] == "eomgen: standard output cannot be written: No space left on device"
    assert len(list(tmp_path.iterdir())) == WRITES.get(name, 0)


@pytest.mark.every(2)
@pytest.mark.parametrize("name", some(QUICKER[1::2], list(COMMANDS)))
def test_ascii_and_a_closed_error_stream(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Of each command: all its files, all it prints in letters of ASCII, and 0."""
    terminal = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", terminal)
    monkeypatch.setattr(sys, "stderr", None)
    assert main([word.format(out=tmp_path) for word in COMMANDS[name].split()]) == 0
    terminal.seek(0)
    shown = terminal.read()
    assert shown and ("\\u" not in shown or name == "schema")  # as JSON spells it anywhere
    assert len(list(tmp_path.iterdir())) == WRITES.get(name, 0)


def test_a_derivation_in_ascii(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its formulas are drawn of ASCII; a file of it is the same whatever the terminal is."""
    target = tmp_path / "derivation.txt"
    terminal = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", terminal)
    assert main(["derive", "two_body"]) == 0
    assert main(["derive", "two_body", "-o", str(target)]) == 0
    terminal.seek(0)
    shown = terminal.read()
    assert "omega_B = thetadot + phidot" in shown and "\\u" not in shown
    assert "ψ_A = θ" in target.read_text("utf-8")


def test_spelling() -> None:
    """Letters that an encoding lacks; those that it has stay."""
    assert spelled("θ̈ = ω·v̇ − 2·ẋ² µs, ½ Σ ≤ 90° …", "ascii") == (
        "theta_ddot = omega*v_dot - 2*x_dot^2 us, 1/2 Sigma <= 90 deg ..."
    )
    assert spelled("Übung: ö² … λ", "latin-1") == "Übung: ö² ... lambda"
    assert spelled("Ü 漢", "ascii") == "U \\u6f22"


class _Full(io.StringIO):
    """A stream that takes a few letters."""

    def write(self, text: str) -> int:
        if len(self.getvalue()) > 5:
            raise OSError(28, "No space left on device")
        return super().write(text)


def test_a_steady_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a terminal would obey is escaped; the first failure is kept; nothing is raised."""
    inner = io.StringIO()
    stream = Steady(inner)
    print("a\x1b[31mb\u202ec\ud800\x9b\nd", file=stream)
    stream.write("\rbar")
    stream.write("over\rwritten")
    assert inner.getvalue() == "a\\x1b[31mb\\u202ec\\ud800\\x9b\nd\n\rbarover\\rwritten"
    inner.close()
    Steady(inner).flush()  # as its finaliser does, whose errors Python shows from 3.15 on
    full = _Full()
    stream = Steady(full)
    for _ in range(5):
        print("1234", file=stream)
    assert full.getvalue() == "1234\n1234"
    assert stream.lost() == "No space left on device"
    monkeypatch.setattr(sys, "stdout", None)
    with steady_streams() as output:
        print("nowhere")
        assert output.lost() == ""
    assert sys.stdout is None


# Interrupts.


LONG = "simulate two_body --integrator rk4 --dt 1e-5 --t-end 90 -o {out}"
STOPS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}
DELAYS = [0.0, *(0.02 * 1.15**k for k in range(36))]
"""Seconds, from before the first import to long after the run has begun."""
LISTENING = """
import sys
import eomgen.__main__ as process
listen = process._listen
process._listen = lambda: (listen(), print("listening", flush=True))
sys.exit(process.main())
"""


def whole(folder: Path) -> bool:
    """Whether every file in a folder is whole, and nothing else is there."""
    for path in folder.iterdir():
        data = path.read_bytes()
        ends = {".py": b"\n", ".csv": b"\n", ".html": b"</html>\n", ".png": b"IEND\xaeB`\x82"}
        if path.suffix == ".npz":
            with zipfile.ZipFile(path) as archive:
                assert archive.testzip() is None
        elif path.suffix not in ends or not data.endswith(ends[path.suffix]):
            return False
    return True


@pytest.fixture
def began() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts a command, and waits until it hears; what still runs in the end is killed."""
    processes = []

    def start(out: Path, command: str = LONG) -> subprocess.Popen[str]:
        words = [word.format(out=out) for word in command.split()]
        process = subprocess.Popen(
            [sys.executable, "-c", LISTENING, *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            env=environment(),
        )
        processes.append(process)
        assert process.stdout is not None and process.stdout.readline() == "listening\n"
        return process

    yield start
    for process in processes:
        process.kill()
        process.communicate()


SOME_STOPS = ((signal.SIGINT, 0.0), (signal.SIGTERM, 0.3), (signal.SIGINT, 1.0))


@pytest.mark.apart
@pytest.mark.parametrize(
    ("number", "delay"),
    some(SOME_STOPS, tuple((number, delay) for number in STOPS for delay in DELAYS)),
    ids=str,
)
def test_a_stop_has_one_exit_code(
    tmp_path: Path,
    began: Callable[..., subprocess.Popen[str]],
    number: signal.Signals,
    delay: float,
) -> None:
    """Whatever the moment, once Python itself has started, whose way to stop is the same but for
    its first hundredths of a second; what is written is whole.
    """
    process = began(tmp_path)
    time.sleep(delay)
    process.send_signal(number)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == STOPS[number], said
    assert said.startswith(("eomgen: interrupted", "eomgen: two_body: interrupted at t = "))
    assert len(said.splitlines()) == 1
    assert whole(tmp_path)


INJECTED = """
import signal, sys
import eomgen.__main__
number, calls, last = signal.Signals[sys.argv[1]], 0, int(sys.argv[2])
sys.argv = ["eomgen", *sys.argv[3:]]
def heard(frame, event, given):
    global calls
    if event == "call":
        calls += 1
        if calls == last:
            sys.setprofile(None)
            signal.raise_signal(number)
sys.setprofile(heard)
code = eomgen.__main__.main()
sys.setprofile(None)
print("calls", calls, file=sys.stderr)
sys.exit(code)
"""


def injected(number: str, last: int, command: str, out: Path) -> subprocess.CompletedProcess[str]:
    """A command that is to stop at its n-th call of a function, or 0 for never."""
    words = [word.format(out=out) for word in command.split()]
    return subprocess.run(
        [sys.executable, "-c", INJECTED, number, str(last), *words],
        check=False,
        capture_output=True,
        encoding="utf-8",
        env=environment(),
        timeout=120,
    )


@pytest.mark.apart
@pytest.mark.parametrize("number", some(("SIGINT",), ("SIGINT", "SIGTERM")))
@pytest.mark.parametrize("name", some(("check",), ("check", "generate", "simulate", "derive")))
def test_a_stop_at_any_call(tmp_path: Path, name: str, number: str) -> None:
    """Among imports, while deriving, running, drawing, writing: one exit code, and whole files."""
    command, first = COMMANDS[name], 100  # before it listens, Python's own way to stop is 130, too
    assert main([word.format(out=tmp_path) for word in command.split()]) == 0  # fills the store
    counted = injected(number, 0, command, tmp_path)
    assert counted.returncode == 0
    calls = int(counted.stderr.split()[-1])
    parts = some(2, 100)
    for k in range(parts):
        done = injected(number, first + (calls - first) * k // parts, command, tmp_path)
        assert done.returncode == STOPS[signal.Signals[number]], (k, done.stderr)
        assert quiet(done) and whole(tmp_path), (k, done.stderr)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # not closed
@pytest.mark.parametrize("before", [None, b"# eomgen trajectory of an earlier run\n"])
def test_a_file_is_whole_or_not_there(tmp_path: Path, before: bytes | None) -> None:
    """Interrupted at any line of the writing: what was there, or all that is new; nothing else."""
    path, data = tmp_path / "made" / "run.csv", b"# eomgen trajectory of this run\n" * 1000
    outcomes = set()
    for last in range(1, 200):
        if before is not None:
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(before)
        lines = 0

        def stopping(frame: FrameType, event: str, given: object, last: int = last) -> Any:
            nonlocal lines
            if frame.f_code.co_filename != eomgen.base.files.__file__:
                return None
            lines += event == "line"
            if lines == last:
                sys.settrace(None)
                raise KeyboardInterrupt
            return stopping

        traced = sys.gettrace()
        try:
            sys.settrace(stopping)
            write_whole(path, data)
            ended = True
        except KeyboardInterrupt:
            ended = False
        finally:
            sys.settrace(traced)
        held = (
            {p.name: p.read_bytes() for p in path.parent.iterdir()} if path.parent.exists() else {}
        )
        assert set(held) <= {path.name}, f"left behind after line {last}: {sorted(held)}"
        outcomes.add(held.get(path.name))
        if ended:
            break
        path.unlink(missing_ok=True)
    assert ended and outcomes == {before, data}


LOST = """
class Deaf:
    def __del__(self): signal.raise_signal(signal.SIGINT)
def run():
    Deaf()
    time.sleep(20)
"""
"""A stop where nothing can be raised, as while something is deleted: Python would only print it."""
TURNED = """
def run():
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        raise ImportError("half a module")
"""
SWALLOWED = """
def run():
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        return 0
"""


@pytest.mark.parametrize(
    ("command", "said"),
    [(LOST, b"eomgen: interrupted\n"), (TURNED, b"eomgen: interrupted\n"), (SWALLOWED, b"")],
    ids=["lost", "turned", "swallowed"],
)
def test_a_stop_counts_whatever_is_made_of_it(command: str, said: bytes) -> None:
    """Lost, turned into another error, or swallowed by a library."""
    code = (
        "import signal, sys, time\nimport eomgen.__main__, eomgen.commands.main\n"
        f"{command}\neomgen.commands.main.main = run\nsys.exit(eomgen.__main__.main())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True, timeout=90
    )
    assert (done.returncode, done.stderr) == (130, said)


def test_an_interrupt_within_this_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """130 when the run keeps what it has, and 130 when there is nothing to keep."""

    def stopped(*given: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("eomgen.run.integrate.all_finite", stopped)
    assert main(["simulate", "pendulum", "-o", str(tmp_path)]) == 130
    assert capsys.readouterr().err == "eomgen: pendulum: interrupted at t = 0\n"
    assert len(list(tmp_path.iterdir())) == 5
    monkeypatch.setattr("eomgen.commands.describing.checked", stopped)
    assert main(["check", "pendulum"]) == 130
    assert capsys.readouterr().err == "eomgen: interrupted\n"
