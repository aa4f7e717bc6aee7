"""Each row a scene with one mistake, and the exact message a user gets for it."""

from pathlib import Path

import pytest

from eomgen.cli import main

GOOD = """\
name = "swing"
[parameters]
m = { value = 1.0, unit = "kg", about = "mass" }
[[bodies]]
name = "arm"
mass = "m"
inertia_com = 0.1
[[bodies]]
name = "hand"
mass = 0.5
inertia_com = 0.02
[[joints]]
name = "shoulder"
type = "revolute"
parent = "world"
child = "arm"
r_child = [-0.5, 0]
[[joints]]
name = "wrist"
type = "revolute"
parent = "arm"
child = "hand"
r_parent = [0.5, 0]
r_child = [-0.1, 0]
[[effects]]
type = "gravity"
g = 9.81
[initial]
q = [0.1, 0.2]
v = [0.0, 0.0]
[simulation]
t_end = 1.0
integrator = "RK45"
"""

BODY = '[[bodies]]\nname = "{}"\nmass = 1.0\ninertia_com = 1.0\n'
JOINT = '[[joints]]\nname = "{}"\ntype = "revolute"\nparent = "{}"\nchild = "{}"\n'

# What is replaced, by what (or None: appended), and the message without the file's name.
MISTAKES = [
    ("name = \"swing\"", "name = swing", "is not TOML: Invalid value (at line 1, column 8)"),
    ("mass = 0.5", "mas = 0.5", "bodies[1].mas: unknown key (did you mean 'mass'?)"),
    ("[initial]", "[inital]", "inital: unknown key (did you mean 'initial'?)"),
    ("mass = 0.5", "", "bodies[1].mass: missing; every such table needs it"),
    ("mass = 0.5", "mass = true", "bodies[1].mass: True is neither a number nor a formula"),
    ("t_end = 1.0", 't_end = "1"', "simulation.t_end: '1' is not a number; give one"),
    ("mass = 0.5", "mass = nan", "bodies[1].mass: nan is not a finite number; give one that is"),
    ("mass = 0.5", "mass = -inf", "bodies[1].mass: -inf is not a finite number; give one that is"),
    ("t_end = 1.0", "t_end = inf", "simulation.t_end: inf is not a finite number; "
     "give one that is"),
    ("value = 1.0", "value = nan", "parameters.m.value: nan is not a finite number; "
     "give one that is"),
    (
        "mass = 0.5",
        "mass = 0",
        "bodies[1].mass: 0 is not positive; give a number > 0 in kg",
    ),
    (
        "mass = 0.5",
        "mass = -2.5",
        "bodies[1].mass: -2.5 is not positive; give a number > 0 in kg",
    ),
    (
        'mass = "m"',
        'mass = "m - 3"',
        "bodies[0].mass: -2 is not positive; give a number > 0 in kg",
    ),
    (
        "inertia_com = 0.02",
        "inertia_com = -0.02",
        "bodies[1].inertia_com: -0.02 is negative; give a number >= 0 in kg m^2",
    ),
    (
        'mass = "m"',
        'mass = "mm"',
        "bodies[0].mass: unknown parameter 'mm' (did you mean 'm'?)",
    ),
    (
        'mass = "m"',
        'mass = "__import__(\'os\')"',
        'bodies[0].mass: "__import__(\'os\')" has something at column 1 that no formula may hold',
    ),
    (
        'mass = "m"',
        'mass = "m.real"',
        "bodies[0].mass: 'm.real' has something at column 1 that no formula may hold",
    ),
    (
        'mass = "m"',
        'mass = "m**999"',
        "bodies[0].mass: 'm**999' has a power at column 1 that is not a whole number 0 to 16",
    ),
    ('mass = "m"', 'mass = "m/0"', "bodies[0].mass: its value is not a finite number; "
     "change its parameters"),
    (
        'parent = "arm"',
        'parent = "arn"',
        "joints[1].parent: no body is named 'arn' (did you mean 'arm'?)",
    ),
    (
        'child = "hand"',
        'child = "foot"',
        "joints[1].child: no body is named 'foot'; known: arm, hand",
    ),
    (
        None,
        JOINT.format("extra", "world", "hand"),
        "joints[2].child: 'hand' is the child of joints[1] too; "
        "in a tree each body has one joint to its parent",
    ),
    (
        'parent = "world"',
        'parent = "hand"',
        "joints[0].parent: 'hand' hangs on its own child 'arm': "
        "the joints make a cycle; let one tree start at the world",
    ),
    (
        None,
        BODY.format("hat"),
        "bodies[2].name: 'hat' is attached to nothing; "
        "give it a joint, of type 'free' if nothing holds it",
    ),
    (
        'name = "hand"',
        'name = "arm"',
        "bodies[1].name: 'arm' is the name of bodies[0] too; give each its own",
    ),
    (
        'name = "wrist"',
        'name = "shoulder"',
        "joints[1].name: 'shoulder' is the name of joints[0] too; give each its own",
    ),
    (
        'name = "hand"',
        'name = "my hand"',
        "bodies[1].name: 'my hand' is no identifier; "
        "use letters a-z, digits and _, a letter first",
    ),
    (
        'name = "hand"',
        'name = "lambda"',
        "bodies[1].name: 'lambda' is a Python keyword; choose another name",
    ),
    (
        'name = "hand"',
        'name = "world"',
        "bodies[1].name: 'world' is the ground; choose another name",
    ),
    (
        "r_child = [-0.5, 0]",
        'r_child = [-0.5, 0]\ncoordinate = "m"',
        "'m' would be the name of a coordinate and of a parameter; rename one of them",
    ),
    (
        "q = [0.1, 0.2]",
        "q = [0.1]",
        "initial.q: has 1 numbers for 2 coordinates; give one each for "
        "shoulder_angle, wrist_angle",
    ),
    (
        "v = [0.0, 0.0]",
        "v = [0.0, 0.0, 0.0]",
        "initial.v: has 3 numbers for 2 coordinates; give one each for "
        "shoulder_angle_dot, wrist_angle_dot",
    ),
    (
        "q = [0.1, 0.2]",
        "q = { wrist_angel = 0.1 }",
        "initial.q.wrist_angel: no coordinate has this name (did you mean 'wrist_angle'?)",
    ),
    (
        'integrator = "RK45"',
        'integrator = "RK54"',
        "simulation.integrator: unknown value 'RK54' (did you mean 'RK45'?)",
    ),
    (
        't_end = 1.0',
        't_end = 1.0\ndt = 0.0',
        "simulation.dt: 0.0 is not positive; give a number > 0",
    ),
    (
        't_end = 1.0',
        't_end = 1.0\ndt = -0.1',
        "simulation.dt: -0.1 is not positive; give a number > 0",
    ),
    (
        'name = "wrist"\ntype = "revolute"',
        'name = "wrist"\ntype = "revolut"',
        "joints[1].type: unknown value 'revolut' (did you mean 'revolute'?)",
    ),
    (
        'name = "wrist"\ntype = "revolute"',
        'name = "wrist"',
        "joints[1].type: missing; it says what kind this is",
    ),
    (
        None,
        '[[effects]]\ntype = "motor"\nname = "tau"\njoint = "elbow"\ntorque = "input"\n',
        "effects[1].joint: no revolute joint is named 'elbow'; known: shoulder, wrist",
    ),
    (
        None,
        '[[effects]]\ntype = "gravity"\nname = "g2"\ng = 1.0\n',
        "effects[1].type: a second 'gravity'; give one",
    ),
    (
        None,
        '[camera]\nfollow = "head"\n',
        "camera.follow: no body is named 'head' (did you mean 'hand'?)",
    ),
    ("r_child = [-0.1, 0]", "r_child = [-0.1]", "joints[1].r_child[1]: missing; "
     "the list is too short"),
    ("mass = 0.5", f"mass = {'9' * 400}", f"bodies[1].mass: {'9' * 57}... is not a finite number; "
     "give one that is"),
    ("mass = 0.5", "mass = 1e101", "bodies[1].mass: 1e+101 is larger than 1e+100; "
     "choose other units"),
    ("t_end = 1.0", "t_end = 1e308", "simulation.t_end: 1e+308 is larger than 1e+100; "
     "choose other units"),
    ("r_child = [-0.5, 0]", "r_child = [1e-200, 0]\n[[effects]]\ntype = 'motor'\nname = 'tau'\n"
     "joint = 'wrist'\ntorque = [1]",
     "effects[0].torque: [1] is neither a number nor a formula"),
    ('name = "swing"', 'name = "swing"\ntitle = "a\\u001b[31mb"',
     "title: 'a\\x1b[31mb' has a character at 2 that cannot be printed; take it out"),
    ("q = [0.1, 0.2]", "q = { wrist_angle = 0.1, wrist_angle_deg = 3.0 }",
     "initial.q.wrist_angle_deg: wrist_angle is given too; give one of them"),
    ('m = { value = 1.0, unit = "kg"', 'm = { value = 1.0, unti = "kg"',
     "parameters.m.unti: unknown key (did you mean 'unit'?)"),
    ("r_child = [-0.1, 0]", "r_child = 3", "joints[1].r_child: 3 is not a list; give one"),
]  # fmt: skip


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A file for a scene."""
    return tmp_path / "swing.toml"


def test_the_scene_without_a_mistake_is_good(
    scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table below would prove nothing if its base were refused."""
    scene.write_text(GOOD)
    assert main(["check", str(scene)]) == 0
    assert "2 degrees of freedom" in capsys.readouterr().out


@pytest.mark.parametrize(("old", "new", "message"), MISTAKES, ids=[row[2] for row in MISTAKES])
def test_one_mistake_one_line(
    scene: Path, capsys: pytest.CaptureFixture[str], old: str | None, new: str, message: str
) -> None:
    """Place, value and remedy on one line of standard error; exit code 1; nothing written."""
    assert old is None or old in GOOD
    scene.write_text(GOOD + new if old is None else GOOD.replace(old, new, 1))
    output = scene.parent / "made"
    assert main(["generate", str(scene), "-o", str(output)]) == 1
    out, err = capsys.readouterr()
    assert err == f"eomgen: swing.toml: {message}\n"
    assert out == ""
    assert not output.exists()


def test_a_file_that_is_not_there(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A path that leads nowhere, a folder, a file that is no text."""
    assert main(["check", "two_boddy"]) == 1
    assert capsys.readouterr().err == (
        "eomgen: two_boddy: no such file, nor a built-in scene (did you mean 'two_body'?)\n"
    )
    assert main(["check", str(tmp_path)]) == 1
    assert capsys.readouterr().err == (
        f"eomgen: {tmp_path}: is a folder; give a scene file in it\n"
    )
    (tmp_path / "picture.toml").write_bytes(b"\x89PNG\xff")
    assert main(["check", str(tmp_path / "picture.toml")]) == 1
    assert capsys.readouterr().err == "eomgen: picture.toml: is not UTF-8 text (byte 0)\n"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ["--integrator", "rk5"],
            "integrator: unknown name 'rk5' (did you mean 'rk4'?); known: euler, "
            "semi_implicit_euler, rk4, implicit_midpoint, RK45, DOP853, Radau, BDF, LSODA",
        ),
        (
            ["--integrator", "rk4", "--dt", "0"],
            "dt: 0 is not a positive step; give e.g. --dt 0.001",
        ),
        (
            ["--integrator", "rk4", "--dt", "-0.1"],
            "dt: -0.1 is not a positive step; give e.g. --dt 0.001",
        ),
        (["--set", "n=1"], "--set: no parameter 'n'; known: m, arm_inertia_com, "),
        (["--set", "m=one"], "--set m=one: gives no finite number; write --set m=1.5"),
        (["--set", "m"], "--set m: gives no finite number; write --set m=1.5"),
        (["--set", "m=-1"], "mass of arm is not positive: change the parameters"),
        (["--samples", "100000000000"], "samples: 100000000000 is too many; give at most 1000000"),
        (["--input", "tau=1"], "--input: no input 'tau'; known: none"),
    ],
)
def test_a_wrong_option(
    scene: Path, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    """The command line's own mistakes read like the scene's, and leave nothing behind."""
    scene.write_text(GOOD)
    output = scene.parent / "out"
    assert main(["simulate", str(scene), "-o", str(output), *options]) == 1
    err = capsys.readouterr().err.rstrip("\n")
    assert err.startswith(f"eomgen: {message}"), err
    assert "\n" not in err
    assert not output.exists() or not list(output.iterdir())


def test_an_unwritable_output(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder that cannot be, and files that others wrote: refused before any work, untouched."""
    scene.write_text(GOOD)
    blocked = scene / "out"
    assert main(["simulate", str(scene), "-o", str(blocked)]) == 1
    assert capsys.readouterr().err == (
        f"eomgen: {blocked}: cannot be made a folder: Not a directory\n"
    )
    theirs = scene.parent / "swing.csv"
    theirs.write_text("t,x\n0,1\n")
    assert main(["simulate", str(scene), "-o", str(scene.parent)]) == 1
    assert capsys.readouterr().err == (
        f"eomgen: {theirs}: exists and was not written by eomgen; "
        "move it away, choose another name, or give --force\n"
    )
    assert theirs.read_text() == "t,x\n0,1\n"
    assert sorted(p.name for p in scene.parent.iterdir()) == ["swing.csv", "swing.toml"]


def test_a_point_mass_too_near_its_pin(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A mechanism whose mass matrix vanishes in double precision is refused, not written."""
    text = GOOD.replace("inertia_com = 0.02", "inertia_com = 0").replace("[-0.1, 0]", "[1e-200, 0]")
    scene.write_text(text)
    output = scene.parent / "made"
    assert main(["generate", str(scene), "-o", str(output)]) == 1
    assert capsys.readouterr().err == (
        "eomgen: swing.toml: the mass matrix is singular at these parameters: "
        "change lengths, masses or inertias\n"
    )
    assert not list(output.iterdir())


def test_two_scenes_of_one_name(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither overwrites the other."""
    scene.write_text(GOOD)
    other = scene.parent / "other.toml"
    other.write_text(GOOD)
    output = scene.parent / "made"
    assert main(["generate", str(scene), str(other), "-o", str(output)]) == 1
    assert capsys.readouterr().err == (
        f"eomgen: {output}/swing.py: would be written for {scene} and for {other}; rename one\n"
    )


def test_a_tree_too_large_for_the_closed_form(
    scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A limit that is said at once, not a derivation that never ends."""
    text = 'name = "chain"\n'
    for i in range(13):
        parent = f"b{i - 1}" if i else "world"
        text += BODY.format(f"b{i}") + JOINT.format(f"j{i}", parent, f"b{i}")
    scene.write_text(text)
    assert main(["generate", str(scene), "-o", str(scene.parent / "made")]) == 1
    assert capsys.readouterr().err == (
        "eomgen: swing.toml: route: the tree at 'b0' has 13 bodies; "
        "the closed form is for small trees, of up to 12\n"
    )


def test_wrong_usage_is_exit_code_2(capsys: pytest.CaptureFixture[str]) -> None:
    """An option that does not exist is the shell's matter, not the scene's."""
    with pytest.raises(SystemExit) as stop:
        main(["simulate", "two_body", "--nonsense"])
    assert stop.value.code == 2
    assert "--nonsense" in capsys.readouterr().err
    with pytest.raises(SystemExit) as stop:
        main(["generate"])
    assert stop.value.code == 2
    assert "no scene; name one" in capsys.readouterr().err
