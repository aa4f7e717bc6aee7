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


LONG = "l" * 93
NAMED = f"""\
name = "two-body"
parameters = {{ upper-mass = 2.0 }}
bodies = [
    {{ name = "upper-arm", mass = "upper_mass", inertia_com = 0.1 }},
    {{ name = "{LONG}", mass = 1, inertia_com = 0.1 }},
]
joints = [
    {{ name = "s-1", type = "revolute", parent = "world", child = "upper-arm" }},
    {{ name = "e", type = "revolute", parent = "upper_arm", child = "{LONG}", r_child = [1, 0] }},
]
effects = [{{ type = "motor", name = "push-it", joint = "s-1", torque = "input" }}]
initial = {{ q = {{ s-1_angle = "60 deg" }} }}
"""


def test_names_may_have_dashes_and_a_hundred_letters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They are identifiers in code, options take them, and no two become the same one."""
    scene = tmp_path / "scene.toml"
    scene.write_text(NAMED)
    run = ["simulate", str(scene), "--set", "upper-mass=3", "--input", "push-it=0.1"]
    assert main([*run, "--t-end", "0.1", "--no-pictures", "-o", str(tmp_path)]) == 0
    source = (tmp_path / "two_body.py").read_text()
    assert "'upper_arm'" in source and LONG in source and '"s_1_angle"' in source
    for old, new, message in (
        (LONG, LONG + "l" * 8, "is longer than 100 characters"),
        (f'"{LONG}", mass', '"upper_arm", mass', "bodies[1].name: 'upper_arm' is the name of bodi"),
        ("= 2.0", "= 2.0, upper_mass = 1", "parameters.upper_mass: is the same name as 'upper-ma"),
        ("s-1_angle =", "s-1_angle = 1, s_1_angle =", "initial.q"),
    ):
        scene.write_text(NAMED.replace(old, new))
        capsys.readouterr()
        assert main(["check", str(scene)]) == 1
        assert message in capsys.readouterr().err
