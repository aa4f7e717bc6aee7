"""How long a newcomer needs for five tasks, with the documentation alone.

    python tests/campaigns/first_tasks.py

prints a table: what is read, what is typed, and how long the commands take, for each task, and the
last line that each task prints. Words
are counted in whole pages, README included, and in what `eomgen reference` prints, and reckoned at
230 a minute. Of files, the lines count that differ from what the page shows to copy; they and the
commands are reckoned at 200 characters a minute. Commands run in a new folder with an empty store.
The scene is `shuttle.toml` beside this file: a load under a cart with a PD controller. The tasks
need python-control and pdflatex, if their own waiting is to count. The exit code is 1 if a command
fails or a task takes ten minutes.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
WORDS, CHARACTERS = 230.0, 200.0
"""Read and typed in a minute."""
LIMIT = 10.0

GAINS = "b = 0.08\nk_x = 0.0\nk_theta = 0.0\nk_v = 0.0\nk_omega = 0.0\n"


@dataclass(frozen=True)
class Task:
    """What is read, changed and typed.

    pages     files of the documentation, in the order in which they are opened
    asked     commands that print more to read
    changes   by name of a new file: the block of the last page that is copied, counted from 0
              among blocks of TOML and Python, and what is replaced in it
    commands  what is run
    """

    name: str
    pages: tuple[str, ...]
    commands: tuple[str, ...]
    changes: tuple[tuple[str, int, tuple[tuple[str, str], ...]], ...] = ()
    asked: tuple[str, ...] = ()


TASKS = (
    Task(
        "a scene of one's own, its figure and page",
        ("README.md", "docs/howto/scene.md"),
        ("eomgen check shuttle.toml", "eomgen simulate shuttle.toml"),
        asked=("eomgen reference weld",),
    ),
    Task(
        "a friction coefficient fitted to a CSV file",
        ("README.md", "docs/howto/fit.md"),
        ("python measure.py", "eomgen fit shuttle.toml measured.csv --names b"),
        (
            (
                "measure.py",
                1,
                (("swing", "shuttle"), ("5.0", "8.0"), ("0.035", "0.3"), ("0.01,", "0.005,")),
            ),
        ),
    ),
    Task(
        "a linear quadratic regulator by python-control",
        ("README.md", "docs/howto/python-control.md"),
        ("python lqr.py",),
        (
            (
                "lqr.py",
                1,
                (
                    ("upright.toml", "upright_shuttle.toml"),
                    ('{"theta": 0.0}', '{"theta_deg": 180}'),
                    ("run['theta'][-1]", "run['theta'][-1] - np.pi"),
                ),
            ),
        ),
    ),
    Task(
        "a sweep over a parameter, with a figure",
        ("README.md", "docs/howto/sweep.md"),
        ("eomgen sweep shuttle.toml --vary b=0:0.5:21 --of theta --samples 101",),
    ),
    Task(
        "the derivation as a page, and as LaTeX compiled by pdflatex",
        ("README.md", "docs/howto/lecture.md"),
        (
            "eomgen derive shuttle.toml -o lecture.html",
            "eomgen derive shuttle.toml -o lecture.tex",
            "pdflatex -interaction=nonstopmode lecture.tex",
        ),
    ),
)


def main() -> int:
    """Do the tasks one after another; print a line for each."""
    done, said = True, []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copy(HERE / "shuttle.toml", folder)
        print("| task | pages | read, words | typed, characters | waiting, s | minutes |")
        print("|---|---|---|---|---|---|")
        for task in TASKS:
            words = sum(len((ROOT / page).read_text("utf-8").split()) for page in task.pages)
            words += sum(len(run(command, folder).split()) for command in task.asked)
            typed = prepare(task, folder)
            typed += sum(len(command) + 1 for command in (*task.commands, *task.asked))
            start = time.perf_counter()
            printed = [run(command, folder) for command in task.commands]
            waited = time.perf_counter() - start
            minutes = words / WORDS + typed / CHARACTERS + waited / 60
            pages = ", ".join(page.removeprefix("docs/") for page in (*task.pages, *task.asked))
            print(f"| {task.name} | {pages} | {words} | {typed} | {waited:.0f} | {minutes:.1f} |")
            said.append(printed[-1].strip().splitlines()[-1])
            done = done and minutes < LIMIT
    print("\nThe last lines that they print:\n")
    print("\n".join(said))
    return 0 if done else 1


def prepare(task: Task, folder: Path) -> int:
    """Write the files of a task; return how many characters of them are typed."""
    page = (ROOT / task.pages[-1]).read_text("utf-8")
    blocks = re.findall(r"^```(?:toml|python)\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    shuttle = (folder / "shuttle.toml").read_text("utf-8")
    if task is TASKS[0]:
        return typed_in(shuttle, blocks[:1])
    count = 0
    if "lqr" in task.commands[0]:
        text = upright(shuttle, blocks[0])
        (folder / "upright_shuttle.toml").write_text(text, "utf-8")
        count += typed_in(text, (shuttle, blocks[0]))
    for name, index, pairs in task.changes:
        text = blocks[index]
        for old, new in pairs:
            if old not in text:
                raise ValueError(f"{task.pages[-1]}: block {index} has no {old!r}")
            text = text.replace(old, new)
        (folder / name).write_text(text, "utf-8")
        count += typed_in(text, (blocks[index],))
    return count


def upright(shuttle: str, shown: str) -> str:
    """The shuttle with the page's input and feedback in place of its controller; its load begins
    above it.
    """
    own, effects = shuttle.index('[[effects]]\ntype = "pd"'), shown.index('[[effects]]\ntype = "m')
    text = shuttle[:own] + shown[effects:].replace("k_theta*theta", "k_theta*(theta - pi)")
    text = text.replace("b = 0.08\n", GAINS).replace("theta_deg = 10", "theta_deg = 170")
    return text.replace('"shuttle"', '"upright_shuttle"')


def typed_in(text: str, shown: Sequence[str]) -> int:
    """The characters of the lines of a file that are in none of the texts that are copied."""
    known = {line for other in shown for line in other.splitlines()}
    return sum(len(line) + 1 for line in text.splitlines() if line not in known)


def run(command: str, folder: Path) -> str:
    """Run a command in a folder, with a store of its own there; return what it prints."""
    words = shlex.split(command)
    programs = {"eomgen": [sys.executable, "-m", "eomgen"], "python": [sys.executable]}
    environment = {**os.environ, "EOMGEN_CACHE": str(folder / "store"), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [*programs.get(words[0], words[:1]), *words[1:]],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"{command}: {done.stdout}{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    sys.exit(main())
