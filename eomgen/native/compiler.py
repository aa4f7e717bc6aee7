"""Finding and running a C compiler."""

import importlib.util
import itertools
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from eomgen.base.errors import RunError

FLAGS = ("-std=c99", "-fPIC", "-shared", "-ffp-contract=off", "-fno-math-errno", "-w")
"""No fast mathematics and no contraction: they would change the last bits of results."""
TUNING = ("-march=native",)
"""Further flags for code that runs on this processor only."""
ORDERED = ("-fschedule-insns", "-fsched-pressure")
"""Flags of GCC, whose default on x86 is not to order instructions before registers are allocated.
Long straight-line code gains 5 to 30 percent, and no bit changes."""
NOT_JOINED = "-fno-tree-slp-vectorize"
"""A flag of GCC, which 12 contracts a*b ± c where it joins statements into vectors, in spite of
`FLAGS`."""
KNOWN = ("cc", "gcc", "clang")
ABSENT = (
    "no C compiler was found; install gcc or clang, name one in CC, or run: "
    "pip install 'eomgen[compiled]'"
)
FOR_MSVC = (
    "compiles for MSVC, where a library shows no functions unless each is marked; name a compiler "
    "of MinGW, or unset CC and run: pip install 'eomgen[compiled]'"
)
LONGEST = 600.0
"""Longest time of a compilation, s."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler: its command, what it prints as its version and target with the processor that
    it compiles for, flags for that one, and flags for the order of instructions.
    """

    command: tuple[str, ...]
    version: str
    tuning: tuple[str, ...] = ()
    ordering: tuple[str, ...] = ()

    def shared_library(self, sources: Mapping[str, str], main: str, *flags: str) -> bytes:
        """Compile the file `main` of `sources` (name to text) into a shared library; return its
        bytes.

        Raises `RunError` with the compiler's first error, or if no temporary file can be written.
        """
        try:
            with tempfile.TemporaryDirectory(prefix="eomgen-") as folder:
                for name, text in sources.items():
                    (Path(folder) / name).write_text(text, "utf-8")
                made = Path(folder) / f"made{suffix()}"
                self._run([*FLAGS, *flags, main, "-o", made.name, "-lm"], folder)
                return made.read_bytes()
        except OSError as error:
            raise RunError(f"the compiled module cannot be made: {error.strerror}") from None

    def _run(self, arguments: list[str], folder: str) -> None:
        try:
            done = subprocess.run(
                [*self.command, *arguments],
                cwd=folder,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=LONGEST,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise RunError(f"{self.command[0]}: not finished after {LONGEST:g} s") from None
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if "error" in line]
            why = (lines or done.stderr.splitlines() or ["it failed without a message"])[0]
            raise RunError(f"{shlex.join(self.command)}: {why}")


def find_compiler() -> Compiler:
    """The first compiler found of `$CC`, cc, gcc, clang and the package `ziglang`.

    It takes arguments as gcc does: cl is none, and clang only where it does not compile for MSVC.
    Raises `RunError` if there is none, or if the one in `$CC` does not run or is no such one.
    """
    return _found(os.environ.get("CC", ""), os.environ.get("PATH", ""))


@cache
def _found(chosen: str, path: str) -> Compiler:
    if chosen.strip():
        try:
            return _asked(words(chosen))
        except (OSError, ValueError, subprocess.SubprocessError):
            raise RunError(f"CC: '{chosen}' does not run; name gcc or clang, or unset it") from None
    commands = [(found,) for name in KNOWN if (found := shutil.which(name, path=path))]
    zig = (sys.executable, "-m", "ziglang", "cc")
    for command in (*commands, *([zig] if importlib.util.find_spec("ziglang") else [])):
        with suppress(OSError, RunError, subprocess.SubprocessError):
            return _asked(command)
    raise RunError(ABSENT)


def words(command: str, system: str = os.name) -> tuple[str, ...]:
    r"""The program and arguments of a command as shells of a system take them: on Windows a \
    separates folders. Raises `ValueError` if a quotation mark has no end.
    """
    if system != "nt":
        return tuple(shlex.split(command))
    return tuple(word.strip("\"'") for word in shlex.split(command, posix=False))


def _asked(command: tuple[str, ...]) -> Compiler:
    """A compiler by its command. Raises `RunError` if it compiles for MSVC, and what
    `subprocess.run` raises.
    """
    done = subprocess.run(
        [*command, "--version"],
        capture_output=True,
        text=True,
        errors="replace",
        timeout=60,
        check=True,
    )
    version, processor = done.stdout.strip(), _processor()
    if "windows-msvc" in version:
        raise RunError(f"{shlex.join(command)}: {FOR_MSVC}")
    gcc = "Free Software Foundation" in version
    ordering = ORDERED if gcc else ()
    tuning: tuple[str, ...] = ()
    if processor and "ziglang" not in command:  # zig compiles for this processor by default
        if gcc:
            tuning = (*TUNING, *ordering, NOT_JOINED)
        elif "clang" in version:
            tuning = TUNING
    known = processor or platform.processor()  # on Windows a family and model
    about = f"{version} {platform.machine()} {sys.platform} {known}"
    return Compiler(command, about, tuning, ordering)


def _processor() -> str:
    """What distinguishes processors that need different code; "" if that is not known."""
    kept = ("model name", "flags", "Features", "CPU part")
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as file:
            lines = itertools.takewhile(str.strip, file)  # the first processor
            return "".join(line for line in lines if line.startswith(kept))
    except (OSError, ValueError):
        return ""


def suffix() -> str:
    """File suffix of a shared library on this system."""
    return {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
