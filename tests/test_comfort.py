"""What makes the command line comfortable: scenes to begin with, help, completion."""

import re
import subprocess
from pathlib import Path

import pytest

from eomgen.cli import main
from eomgen.scene.built_in import BUILT_IN
from eomgen.scene.reader import read_scene
from eomgen.usage import EXAMPLES


def test_a_new_scene_runs_and_is_not_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`new`, `copy` and `show`: the file has its own name; what is there stays."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "swing"]) == 0
    assert read_scene(Path("swing.toml")).name == "swing"
    assert main(["simulate", "swing.toml", "--t-end", "0.1", "--no-pictures"]) == 0
    Path("swing.toml").write_text("mine")
    assert main(["new", "swing"]) == main(["copy", "pendulum", "swing.toml"]) == 1
    assert Path("swing.toml").read_text() == "mine"
    assert "swing.toml: exists; choose another name" in capsys.readouterr().err
    assert main(["copy", "pendulum", "my_pendulum"]) == main(["copy", "cart_pole"]) == 0
    copied, own = read_scene(Path("my_pendulum.toml")), read_scene("pendulum")
    assert copied.replaced(name="pendulum") == own
    assert main(["new", "if"]) == main(["copy", "no_such"]) == 1
    assert sorted(path.name for path in tmp_path.glob("*.toml")) == [
        "cart_pole.toml",
        "my_pendulum.toml",
        "swing.toml",
    ]
    capsys.readouterr()
    assert main(["show", "pendulum"]) == 0
    assert capsys.readouterr().out == (BUILT_IN / "pendulum.toml").read_text("utf-8")


def commands(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The commands that `--help` lists."""
    with pytest.raises(SystemExit):
        main(["--help"])
    return re.findall(r"^    (\w+)(?:  |$)", capsys.readouterr().out, re.MULTILINE)


def test_help_states_defaults_and_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    """Every command has an example that its own parser takes; every option has a text."""
    names = commands(capsys)
    assert sorted(names) == sorted(EXAMPLES)
    for name in names:
        with pytest.raises(SystemExit):
            main([name, "--help"])
        text = capsys.readouterr().out
        assert text.rstrip().endswith(f"example: {EXAMPLES[name]}")
        with pytest.raises(SystemExit) as stop:
            main([*EXAMPLES[name].partition(">")[0].split()[1:], "--help"])
        assert stop.value.code == 0
        for option in re.findall(r"^  (-.*(?:\n {8,}.*)*)", text, re.MULTILINE):
            assert re.search(r"(\s{2,}|\n\s+)\w", option), f"{name}: {option}"
    with pytest.raises(SystemExit):
        main(["simulate", "--help"])
    assert "rows to keep (default: 1001)" in capsys.readouterr().out


def test_completion_is_a_script_of_the_shell(capsys: pytest.CaptureFixture[str]) -> None:
    """It names commands, options and scenes; bash takes it and completes a scene with it."""
    for shell in ("bash", "zsh", "fish"):
        assert main(["completion", shell]) == 0
        script = capsys.readouterr().out
        assert all(word in script for word in ("linearise", "integrator", "two_body_forced"))
        if shell == "bash":
            call = "COMP_WORDS=(eomgen simulate two_body_); COMP_CWORD=2; _shtab_eomgen"
            call += '; printf "%s\\n" "${COMPREPLY[@]}"'
            done = subprocess.run(
                ["bash", "-c", f"{script}\n{call}"], capture_output=True, text=True, check=True
            )
            assert done.stdout.split() == ["two_body_forced"]
