"""What makes the command line comfortable: scenes to begin with, help, completion."""

import io
import json
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from scenes import effect, lone

import eomgen
from eomgen.commands import durations, generating
from eomgen.commands.main import main
from eomgen.commands.table import COMMANDS
from eomgen.run import progress
from eomgen.scene.built_in import BUILT_IN
from eomgen.scene.reader import read_scene


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
    assert sorted(names) == sorted(COMMANDS)
    for name in names:
        with pytest.raises(SystemExit):
            main([name, "--help"])
        text = capsys.readouterr().out
        assert text.rstrip().endswith(f"example: {COMMANDS[name].example}")
        with pytest.raises(SystemExit) as stop:
            main([*COMMANDS[name].example.partition(">")[0].split()[1:], "--help"])
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
        (f'"{LONG}", mass', '"upper_arm", mass', "bodies[1].name: 'upper_arm' is also the"),
        ("= 2.0", "= 2.0, upper_mass = 1", "parameters.upper_mass: is the same name as 'upper-ma"),
        ("s-1_angle =", "s-1_angle = 1, s_1_angle =", "initial.q"),
    ):
        scene.write_text(NAMED.replace(old, new))
        capsys.readouterr()
        assert main(["check", str(scene)]) == 1
        assert message in capsys.readouterr().err


class Screen(io.StringIO):
    """A terminal that keeps what is written to it."""

    def isatty(self) -> bool:
        return True

    def frames(self) -> list[str]:
        """What the line showed, one after another."""
        return [text.strip() for text in self.getvalue().split("\r") if text.strip()]


def test_long_work_shows_the_time_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of known length by its fraction; of unknown length as long as it took the last time."""
    screen, clock = Screen(), [0.0]
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    with progress.terminal_progress("running") as report:
        report(0.1)
        for clock[0], fraction in ((1.0, 0.2), (600.0, 0.7)):
            report(fraction)
    assert screen.frames()[1].endswith("20%, about 8 s left")
    assert screen.frames()[2].endswith("70%, about 5 min left")
    monkeypatch.undo()
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path))
    monkeypatch.setattr(progress, "TICK", 0.05)
    monkeypatch.setattr(durations, "SHORTEST", 0.01)
    shown = []
    for _ in range(2):
        screen = Screen()
        monkeypatch.setattr(sys, "stderr", screen)
        with durations.timed_notice("deriving it …"):
            time.sleep(0.2)
        shown.append(screen.frames())
    assert shown[0][0] == "deriving it …" and shown[0][-1] == "deriving it … 0 s"
    assert any(frame.endswith("about 0 s left") for frame in shown[1])
    (tmp_path / "durations.json").write_text("[broken")
    monkeypatch.setattr(sys, "stderr", io.StringIO())  # a pipe
    with durations.timed_notice("deriving it …"):
        time.sleep(0.02)
    assert sys.stderr.getvalue() == ""
    assert json.loads((tmp_path / "durations.json").read_text()).keys() == {"deriving it …"}


def test_an_interrupt_says_what_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of several modules those that are written; of others that nothing is."""
    made = generating._generate

    def interrupted(scene: str, *rest: object) -> bool:
        if scene == "two_body":
            raise KeyboardInterrupt
        return made(scene, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(generating, "_generate", interrupted)
    assert main(["generate", "pendulum", "two_body", "acrobot", "-o", str(tmp_path)]) == 130
    said = "eomgen: interrupted at two_body; 1 of 3 modules are written\n"
    assert capsys.readouterr().err == said
    assert [path.name for path in tmp_path.iterdir()] == ["pendulum.py"]
    monkeypatch.setattr(
        "eomgen.commands.deriving.derivation_of", lambda *_, **__: interrupted("two_body")
    )
    assert main(["derive", "pendulum"]) == 130
    assert "interrupted; what was derived is kept" in capsys.readouterr().err


DASHED = lone(
    "revolute",
    effect("motor", name="drive", joint="left-pin", torque="wind_speed - left_pin_angle"),
    body="left-arm",
    on="left-pin",
    name="dashed",
    inputs=["wind-speed"],
    parameters={"arm-1": 2.0},
    definitions={"half": "arm_1/2"},
    mass="half",
)


def test_a_name_is_taken_with_either_sign(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`-` and `_` are one name wherever one is asked for; in formulas - subtracts."""
    run = eomgen.simulate(
        DASHED,
        parameters={"arm-1": 3.0},
        inputs={"wind-speed": 1.0},
        state={"left-pin_angle": 0.5},
        t_end=0.1,
    )
    assert run["left-pin_angle"].tolist() == run["left_pin_angle"].tolist() != []
    members = eomgen.grid({"arm-1": [1, 2], "wind-speed": [0, 1]})
    found = eomgen.ensemble(DASHED, members, t_end=0.1, workers=1)
    assert found.of("arm-1").tolist() == found.of("arm_1").tolist() == [1, 1, 2, 2]
    assert found.statistics("left-pin_angle").mean.tolist() == [
        found.of("left_pin_angle").mean().tolist()
    ]
    trimmed = eomgen.linearise(DASHED, hold=["left-pin_angle"], trim=["wind-speed"])
    assert trimmed.u.tolist() == [0.0]
    with pytest.raises(eomgen.RunError, match="a name is given twice"):
        eomgen.grid({"arm-1": [1.0], "arm_1": [1.0]})
    file = tmp_path / "dashed.toml"
    file.write_text(DASHED)
    command = ["sweep", str(file), "--vary", "arm-1=1,2", "--of", "left-pin_angle", "-o"]
    assert main([*command, str(tmp_path / "out"), "--t-end", "0.1", "--workers", "1"]) == 0
    assert "left_pin_angle at the end" in capsys.readouterr().out
    hint = r"did you mean '{}'\? In formulas - subtracts"
    for text, name in (
        (DASHED.replace('"half"', '"2*(arm-1)"'), "arm_1"),
        (DASHED.replace("arm_1/2", "2*(arm-1)"), "arm_1"),
        (DASHED.replace("left_pin_angle", "left-pin-angle"), "left_pin_angle"),
    ):
        with pytest.raises(eomgen.SceneError, match=hint.format(name)):
            eomgen.check(text)


def test_what_looks_like_a_mistake_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An angle in degrees without `_deg`, and gravity with a sign. Neither is an error."""
    scene = tmp_path / "odd.toml"
    text = (BUILT_IN / "double_pendulum.toml").read_text()
    scene.write_text(
        text.replace("g = { value = 9.81", "g = { value = -9.81").replace("theta_1_deg", "theta_1")
    )
    assert main(["check", str(scene)]) == 0
    said = capsys.readouterr().err
    assert (
        "initial.q.theta_1: 30 rad are more than two turns; for degrees write theta_1_deg" in said
    )
    assert "gravity.g: is -9.81 m/s², so bodies fall upwards; for downwards write 9.81" in said
