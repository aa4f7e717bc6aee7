"""What systems other than this one lack or do otherwise, as far as that can be tried here; and the
versions that the documentation promises.
"""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

import pytest

import eomgen
from eomgen.base.errors import RunError
from eomgen.commands.main import main
from eomgen.native import compiler
from eomgen.scene.importers.meshes import local
from eomgen.sweep import processes, storage

ROOT = Path(eomgen.__file__).parent.parent
COMPATIBILITY = ROOT / "docs" / "compatibility.md"
LACKING = """
import os, signal, sys
for name in ("O_NOFOLLOW", "O_NONBLOCK", "geteuid", "posix_fallocate", "supports_fd"):
    delattr(os, name)
os.supports_fd = set()
for name in ("SIGHUP", "setitimer", "pthread_sigmask"):
    delattr(signal, name)
sys.modules["fcntl"] = sys.modules["resource"] = None
import eomgen.__main__
from multiprocessing import set_start_method
set_start_method("spawn")
sys.argv[1:] = "sweep pendulum --vary theta=0:1:4 --t-end 0.1 --workers 2 --backend numpy".split()
assert eomgen.__main__.main() == 0
sys.argv[1:] = "simulate pendulum --t-end 0.1".split()
sys.exit(eomgen.__main__.main())
"""
"""A process with no more than Windows has; its workers have all."""
UNGUARDED = """
import multiprocessing
import eomgen
multiprocessing.set_start_method("spawn", force=True)
eomgen.ensemble("pendulum", {"theta": [0.0, 1.0]}, t_end=0.1, workers=2, backend="numpy")
"""


def test_the_support_window_is_that_of_the_package() -> None:
    """The page, the package and the campaign's table state the same lowest versions."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    lowest = dict(text.split(">=") for text in project["dependencies"])
    lowest["python"] = project["requires-python"].removeprefix(">=")
    page = COMPATIBILITY.read_text("utf-8")
    stated = dict(re.findall(r"^\| (\S+) \| (\d\S*) \|$", page, re.MULTILINE))
    assert {name.lower(): version for name, version in stated.items()} == lowest
    ran = set(re.findall(r"^\| (3\.\d+)\.\d+ \|.*\| ran", page, re.MULTILINE))
    said = {c.rpartition(" ")[2] for c in project["classifiers"] if "Python :: 3." in c}
    assert said and said <= ran, "a classifier is for a Python that was run"


def test_commands_of_compilers_are_those_of_the_system() -> None:
    """On Windows a backslash separates folders."""
    assert compiler.words("ccache gcc-12 '-I a'", "posix") == ("ccache", "gcc-12", "-I a")
    assert compiler.words(r'"C:\Program Files\LLVM\clang.exe" -m64', "nt") == (
        r"C:\Program Files\LLVM\clang.exe",
        "-m64",
    )
    assert compiler.words(r"C:\mingw\bin\gcc.exe", "nt") == (r"C:\mingw\bin\gcc.exe",)


@pytest.mark.skipif(os.name != "posix", reason="compilers of this test are scripts of the shell")
def test_a_compiler_for_msvc_is_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its libraries would show no functions: the next one is taken, and one in CC is refused."""
    for name, says in (("gcc", "x86_64-pc-windows-msvc"), ("clang", "x86_64-w64-windows-gnu")):
        path = tmp_path / name
        path.write_text(f"#!/bin/sh\nprintf 'clang version 20\\nTarget: {says} \\377\\n'\n")
        path.chmod(0o700)
    assert compiler._found.__wrapped__("", str(tmp_path)).command == (str(tmp_path / "clang"),)
    with pytest.raises(RunError, match=r"gcc: compiles for MSVC, .* pip install 'eomgen\[compi"):
        compiler._found.__wrapped__(str(tmp_path / "gcc"), "")


def test_a_sweep_is_locked_by_windows_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there is no fcntl, but msvcrt; without either a sweep runs unlocked."""
    path, held = tmp_path / "sweep.json", set[tuple[int, int]]()
    path.write_text("{}")

    def locking(handle: int, mode: int, size: int) -> None:
        at = os.fstat(handle).st_ino, os.lseek(handle, 0, os.SEEK_CUR)
        if at in held:
            raise PermissionError(13, "Permission denied")
        held.add(at)

    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", None)
    with storage._alone(path), storage._alone(path):
        pass
    windows: Any = SimpleNamespace(locking=locking, LK_NBLCK=2)
    monkeypatch.setitem(sys.modules, "msvcrt", windows)
    with storage._alone(path):
        ((_, place),) = held
        assert place >= path.stat().st_size, "nobody could read what is locked"
        with pytest.raises(RunError, match="another process runs this sweep"), storage._alone(path):
            pass


@pytest.mark.full
def test_what_windows_lacks_is_done_without(tmp_path: Path) -> None:
    """No flags and calls of POSIX, no locks, and processes that are no copies."""
    done = run(LACKING, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "4 finished" in done.stdout and (tmp_path / "out" / "pendulum.npz").is_file()


@pytest.mark.full
def test_a_script_without_its_guard_is_told_so(tmp_path: Path) -> None:
    """Each process imports the script, and would start its own."""
    path = tmp_path / "script.py"
    path.write_text(UNGUARDED)
    done = run(path, tmp_path)
    assert done.returncode == 1
    assert done.stderr.rstrip().splitlines()[-1].endswith("around what starts workers")


def test_where_no_process_can_be_started(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a browser: one line, and one worker runs all members."""
    members = {"theta": [0.0, 1.0]}
    for name in ("_multiprocessing", "multiprocessing.synchronize"):
        monkeypatch.setitem(sys.modules, name, None)
    with (
        pytest.raises(RunError, match=r"^this Python cannot start processes; give workers=1$"),
        processes._team(2),
    ):
        pass
    assert eomgen.ensemble("pendulum", members, t_end=0.1, backend="numpy").finished.all()


def run(code: str | Path, folder: Path) -> "subprocess.CompletedProcess[str]":
    """A process of Python in a folder."""
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, *(["-c", code] if isinstance(code, str) else [code])]
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=120)


def test_names_that_differ_by_case_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They would be one file on macOS and Windows."""
    scene = (ROOT / "eomgen" / "scenes" / "pendulum.toml").read_text("utf-8")
    for name in ("Swing", "swing"):
        text = re.sub(r'^name = "pendulum"', f'name = "{name}"', scene, flags=re.MULTILINE)
        (tmp_path / f"of_{name}.toml").write_text(text, "utf-8")
    monkeypatch.chdir(tmp_path)
    assert main("generate of_Swing.toml of_swing.toml -o made".split()) == 1
    assert "swing.py: would be written for of_Swing.toml and for of_swing.toml" in (
        capsys.readouterr().err
    )
    with pytest.raises(RunError, match="two scenes are named"):
        eomgen.gallery("shown", ["of_Swing.toml", "of_swing.toml"])


def test_addresses_of_files_on_windows() -> None:
    """A drive follows the slash of the address."""
    assert local("/C:/robots/arm.stl", "nt") == "C:/robots/arm.stl"
    assert local("/C:/robots/arm.stl", "posix") == "/C:/robots/arm.stl"
    assert local("meshes/arm.stl", "nt") == "meshes/arm.stl"


def test_lengths_of_files(tmp_path: Path) -> None:
    """Set by the handle, with no call that some systems have for paths alone."""
    with (tmp_path / "numbers").open("w+b") as file:
        for size in (100, 10):
            storage._resize(file.fileno(), size)
            assert len_of(file) == size


def len_of(file: BinaryIO) -> int:
    """The size of an open file, bytes."""
    return os.fstat(file.fileno()).st_size
