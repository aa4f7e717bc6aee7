"""The command line as a user meets it."""

import hashlib
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from campaign import some
from digests import SUMS, known

from eomgen.base.files import remove_ours
from eomgen.commands.main import main
from eomgen.model.elaborate import elaborate
from eomgen.scene.reader import BUILT_IN, built_in_names, parse_scene
from eomgen.store import generated_code

ROOT = Path(__file__).parent.parent.parent
LARGE = (
    "car_suspension chain hanging_figure human_figure peaucellier quadruped ragdoll stiff_beam "
    "stewart_platform walker_motors"
).split()
pytestmark = pytest.mark.usefixtures("blank_figures")


@pytest.mark.apart
@pytest.mark.parametrize("seed", some(("1",), ("0", "1", "2")))
def test_committed_modules_are_what_is_generated(tmp_path: Path, seed: str) -> None:
    """Built-in scenes derived anew give the committed bytes, or the committed digest, whatever the
    seed of Python's hashes; nothing else is there. An ordinary run derives one of
    the small ones; `.ci/run` has them all.
    """
    names = [name for name in built_in_names() if name not in some(LARGE, ())]
    names = some(names[::30], names)
    committed = ROOT / "generated"
    done = subprocess.run(
        [sys.executable, "-m", "eomgen", "generate", *names, "--check", "-o", str(committed)],
        env={**os.environ, "PYTHONHASHSEED": seed, "EOMGEN_CACHE": str(tmp_path)},
        check=False,
        capture_output=True,
        text=True,
    )
    lines = done.stdout.splitlines()
    assert [line for line in lines if not line.endswith(": fresh")] == []
    assert done.returncode == 0 and len(lines) == len(names)
    kept = [path.name for path in committed.glob("*.py")]
    assert sorted([*kept, *known()]) == [f"{name}.py" for name in sorted(built_in_names())]
    found = {path.name for path in committed.iterdir()} - {"__pycache__"}  # if any was imported
    assert found == {*kept, SUMS.name}


def test_a_digest_stands_for_a_module(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of a module that is not kept: fresh by its digest, stale by another."""
    sums, out = tmp_path / SUMS.name, str(tmp_path)
    right = hashlib.sha256((ROOT / "generated" / "pendulum.py").read_bytes()).hexdigest()
    for digest, word, code in ((right, "fresh", 0), ("0" * 64, "stale", 1)):
        sums.write_text(f"{digest}  pendulum.py\n")
        assert main(["generate", "pendulum", "--check", "-o", out]) == code
        assert capsys.readouterr().out == f"{tmp_path}/pendulum.py: {word}\n"


def test_check_says_which_module_is_stale(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fresh, edited and missing modules are distinguished; the exit code is 1; nothing is
    written.
    """
    out = str(tmp_path)
    assert main(["generate", "pendulum", "two_body", "-o", out]) == 0
    edited = tmp_path / "two_body.py"
    edited.write_text(edited.read_text("utf-8").replace("9.81", "9.80"), "utf-8")
    before = edited.read_bytes()
    capsys.readouterr()
    scenes = ["pendulum", "two_body", "double_pendulum"]
    assert main(["generate", *scenes, "--check", "-o", out]) == 1
    text = capsys.readouterr()
    assert text.out.splitlines() == [
        f"{tmp_path}/pendulum.py: fresh",
        f"{tmp_path}/two_body.py: stale",
        f"{tmp_path}/double_pendulum.py: missing",
    ]
    assert (
        text.err == f"eomgen: 2 stale; run: eomgen generate {' '.join(scenes[1:])} -o {tmp_path}\n"
    )
    assert edited.read_bytes() == before
    assert main(["generate", "two_body", "-o", out]) == 0
    assert main(["generate", "two_body", "--check", "-o", out]) == 0


def test_a_file_that_only_mentions_this_program_is_not_ours(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Notes about eomgen, or its README, are no output of it; what it did write is replaced."""
    notes = tmp_path / "notes.txt"
    notes.write_text("# my notes on eomgen\n")
    assert main(["derive", "pendulum", "-o", str(notes)]) == 1
    assert "was not written by eomgen" in capsys.readouterr().err
    assert notes.read_text() == "# my notes on eomgen\n"
    for form in ("text", "latex", "html"):
        target = str(tmp_path / f"pendulum.{form}")
        for _ in range(2):
            assert main(["derive", "pendulum", "--format", form, "-o", target]) == 0


def test_the_ending_of_a_file_says_the_format(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A page into .html and LaTeX into .tex, unless a format is asked for; never a PDF."""
    assert main(["derive", "pendulum", "-o", str(tmp_path / "a.pdf")]) == 1
    assert "a.tex, of which pdflatex makes a PDF" in capsys.readouterr().err
    begins = {"a.html": "<!doctype html>", "a.tex": "% Generated", "a.txt": "Simple pendulum"}
    for name, begin in begins.items():
        assert main(["derive", "pendulum", "-o", str(tmp_path / name)]) == 0
        assert (tmp_path / name).read_text("utf-8").startswith(begin)
    target = str(tmp_path / "a.html")
    assert main(["derive", "pendulum", "--format", "text", "-o", target]) == 0
    assert (tmp_path / "a.html").read_text("utf-8").startswith(begins["a.txt"])


def test_only_our_own_files_are_removed(tmp_path: Path) -> None:
    """Pictures of an earlier run go; a stranger's file, or none, is left alone."""
    ours, theirs = tmp_path / "ours.html", tmp_path / "theirs.html"
    ours.write_text('<meta name="generator" content="eomgen">')
    theirs.write_text("<title>mine</title>")
    for path in (ours, theirs, tmp_path / "none.html", tmp_path):
        remove_ours(path)
    assert [path.name for path in tmp_path.iterdir()] == ["theirs.html"]


def test_a_run_without_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It loads no Matplotlib, leaves no picture of an earlier run, and none can be asked for."""
    run = ["simulate", "pendulum", "--t-end", "0.1", "-o", str(tmp_path)]
    assert main(run) == 0
    assert len(list(tmp_path.iterdir())) == 5
    code = (
        "import sys; from eomgen.commands.main import main; code = main(sys.argv[1:]); "
        "sys.exit(code or 10 * ('scipy' in sys.modules or 'matplotlib' in sys.modules))"
    )
    subprocess.run([sys.executable, "-c", code, *run, "--no-pictures"], check=True)
    assert {path.suffix for path in tmp_path.iterdir()} == {".py", ".npz", ".csv"}
    capsys.readouterr()
    for other in (["--plot", "a.svg"], ["--view"]):
        assert main([*run, "--no-pictures", *other]) == 1
        assert f"{other[0]} asks for a picture" in capsys.readouterr().err


def test_check_and_list(capsys: pytest.CaptureFixture[str]) -> None:
    """What a scene is made of, and which scenes there are."""
    assert main(["list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(
        built_in_names()
    )
    assert main(["check", "two_body_forced"]) == 0
    shown = capsys.readouterr()
    lines = shown.out.splitlines()
    assert "dimensions  2: the plane" in lines
    assert "freedom     4 degrees of freedom" in lines
    assert "joint       hinge: revolute, A to B; phi" in lines
    assert "effects     gravity, 2 external_force, motor" in lines
    assert "inputs      f_A_x, f_A_y, f_B_x, f_B_y, tau" in lines
    assert shown.err == ""
    assert main(["check", "human_figure"]) == 0
    out = capsys.readouterr().out
    assert "dimensions  3: space\n" in out
    assert "41 degrees of freedom, 49 coordinates with 8 unit quaternions\n" in out
    assert max(map(len, out.splitlines())) <= 100


def test_check_of_a_long_chain_is_short(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The first few and the last of a hundred links; all of them on request."""
    scene = tmp_path / "long.toml"
    text = (BUILT_IN / "chain.toml").read_text("utf-8")
    scene.write_text(text.replace("count = 10", "count = 100"), "utf-8")
    assert main(["check", str(scene)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) < 30 and max(map(len, lines[:-1])) <= 100
    assert "joint       … 89 more …" in lines
    assert any("link_joint_100: revolute, link_99 to link_100" in line for line in lines)
    assert lines[-1].endswith("--long lists all")
    assert main(["check", str(scene), "--long"]) == 0
    out = capsys.readouterr().out
    assert out.count("joint       ") == 100 and "more …" not in out
    assert "link_50_mass = 0.1" in out


ARM = """
name = "arm"
dimensions = 3
bodies = [
    { name = "upper", mass = 1, inertia_com = [0.1, 0.1, 0.1] },
    { name = "lower", mass = 1, inertia_com = [0.1, 0.2, 0.2] },
]
joints = [
    { name = "s", type = "revolute", parent = "world", child = "upper", axis = [0, 2, 0], r_child = [-0.5, 0, 0], limits = [-0.5, 1.0] },
    { name = "w", type = "ball", parent = "upper", child = "lower", r_child = [-0.5, 0, 0], r_parent = [0.5, 0, 0] },
]
effects = [{ type = "gravity", g = 9.81 }]
initial = { q = { w_qw = 2.0 } }
route = "aba"
"""  # noqa: E501


def test_notices_and_limits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What was put right is said on standard error; who left its limits, and when, at the end."""
    scene = tmp_path / "arm.toml"
    scene.write_text(ARM, "utf-8")
    notices = [
        "eomgen: note: arm.toml:9: joints[0].axis: has length 2; taken as a direction of length 1",
        "eomgen: note: arm.toml:13: initial.q: the quaternion that starts at w_qw has length 2; "
        "scaled to 1",
    ]
    out = str(tmp_path / "out")
    for command in (
        ["check", str(scene)],
        ["generate", str(scene), "-o", out],
        ["simulate", str(scene), "-o", out, "--t-end", "1"],
    ):
        assert main(command) == 0
        shown = capsys.readouterr()
        assert shown.err.splitlines() == notices
        if command[0] == "check":
            assert "s: revolute, world to upper; s_angle from -0.5 to 1 rad\n" in shown.out
            assert "4 degrees of freedom, 5 coordinates with 1 unit quaternion\n" in shown.out
    said = re.search(
        r"    s_angle leaves its limits -0.5 to 1 rad at t = (\S+) s; "
        r"farthest (\S+) rad at t = (\S+) s\n    limits are reported, not enforced\n",
        shown.out,
    )
    assert said
    since, farthest, at = map(float, said.groups())
    rows = np.loadtxt(tmp_path / "out" / "arm.csv", delimiter=",", skiprows=1)
    outside = (rows[:, 1] < -0.5) | (rows[:, 1] > 1.0)
    assert since == pytest.approx(rows[outside][0, 0], rel=1e-3)
    assert farthest == pytest.approx(rows[:, 1].max(), rel=1e-3)
    assert at == pytest.approx(rows[np.argmax(rows[:, 1]), 0], rel=1e-3)
    assert main(["simulate", str(scene), "-o", out, "--t-end", "0.1"]) == 0
    assert " limits" not in capsys.readouterr().out
    stop = '{ type = "joint_stop", name = "end", joints = ["s"], high = 1.0, stiffness = 9.0 }'
    scene.write_text(ARM.replace("g = 9.81 }", f"g = 9.81 }}, {stop}"), "utf-8")
    assert main(["simulate", str(scene), "-o", out, "--t-end", "1"]) == 0
    assert " limits" not in capsys.readouterr().out, "a stop enforces them"
    scene.write_text(ARM.replace("[-0.5, 1.0]", "[0.5, 1.0]"), "utf-8")
    assert main(["simulate", str(scene), "-o", out, "--t-end", "0.1"]) == 0
    assert "s_angle starts outside its limits 0.5 to 1 rad; " in capsys.readouterr().out


def test_routes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file of each, named after it where it is not the scene's own; why one was taken."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path / "store"))
    out = str(tmp_path)
    base = ["generate", "cart_pole", "-o", out]
    for route, name in (("auto", "cart_pole"), ("ldl", "cart_pole_ldl"), ("aba", "cart_pole_aba")):
        assert main([*base, "--route", route]) == 0
        assert capsys.readouterr().out == f"{tmp_path}/{name}.py: written\n"
    assert main([*base, "--route", "aba", "--check"]) == 0
    assert main(["generate", "acrobot", "-o", out, "--route", "ldl", "--check"]) == 1
    assert capsys.readouterr().err == (
        f"eomgen: 1 stale; run: eomgen generate acrobot -o {tmp_path} --route ldl\n"
    )
    assert main(["generate", "two_body", "--form", "momentum", "-o", out]) == 0
    assert main(["generate", "two_body", "--form", "velocity", "-o", out]) == 0
    assert {"two_body.py", "two_body_momentum.py"} < {path.name for path in tmp_path.iterdir()}
    options = ["--route", "ldl", "--t-end", "0.01"]
    assert main(["simulate", "cart_pole", "-o", out, *options]) == 0
    assert (tmp_path / "cart_pole_ldl.csv").exists()
    capsys.readouterr()
    assert main(["generate", "human_figure", "--route", "closed", "-o", out]) == 1
    assert capsys.readouterr().err.startswith(
        "eomgen: human_figure.toml: route: 'closed' needs the closed form, and "
    )
    assert main(["generate", "two_body", "--form", "momentum", "--route", "aba", "-o", out]) == 1
    assert "route: 'aba' is for form = 'velocity'" in capsys.readouterr().err
    with pytest.raises(SystemExit) as stop:
        main([*base, "--route", "abba"])
    assert stop.value.code == 2


def test_works_are_booked_where_they_are_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["simulate", "pendulum", "--outputs", "momentum", "-o", str(tmp_path), "--t-end", "1"]
    for asked in ([], ["--works"]):
        assert main([*command, *asked]) == 0
        said, table = capsys.readouterr().out, (tmp_path / "pendulum.csv").read_text("utf-8")
        assert ("    work: gravity " in said) is bool(asked)
        assert ("J unaccounted for" in said) is bool(asked)
        assert table.splitlines()[0].endswith(",work_gravity") is bool(asked)
        module = (tmp_path / "pendulum.py").read_text("utf-8")
        assert ("def effect_powers" in module) is bool(asked)


def test_the_route_is_explained(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The routes with their costs, the one taken marked; kept with a module that is fresh."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path / "store"))
    command = ["generate", "tumbling_body", "--explain", "--report", "-o", str(tmp_path)]
    assert main(command) == 0
    first = capsys.readouterr().out.splitlines()
    assert first[0] == f"{tmp_path}/tumbling_body.py: written"
    assert first[1].split()[:2] == ["route", "cost"]
    taken = [line.split() for line in first if line.endswith("<- taken")]
    assert len(taken) == 1
    counts = {line.split()[0]: line.split()[1] for line in first[2:5]}
    assert set(counts) == {"closed", "aba", "ldl"} and counts["ldl"] == "-"
    docstring = (tmp_path / "tumbling_body.py").read_text("utf-8")
    assert int(taken[0][1]) == min(int(cost) for cost in counts.values() if cost != "-")
    assert re.search(r"One call of `derivative` takes \d+ operations", docstring)

    def never(model: object) -> None:
        raise AssertionError("derived again")

    monkeypatch.setattr("eomgen.pipeline.generate", never)
    assert main(command) == 0
    again = capsys.readouterr().out.splitlines()
    assert again[0] == f"{tmp_path}/tumbling_body.py: fresh" and again[1:] == first[1:]


def test_outputs_are_chosen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is named is generated and nothing else, by the rules of the scene's own key."""
    out = str(tmp_path)
    base = ["generate", "cart_pole", "--route", "aba", "-o", out]
    target = tmp_path / "cart_pole_aba.py"
    assert main([*base, "--outputs", "momentum, input_jacobian"]) == 0
    text = target.read_text("utf-8")
    always = {"initial_state", "derivative", "jacobian"}
    assert set(re.findall(r"^def ([a-z]\w+)\(", text, re.MULTILINE)) == {
        "momentum",
        "input_jacobian",
        *always,
    }
    assert main([*base, "--outputs", "all"]) == 0
    assert "def point_jacobians(" in target.read_text("utf-8")
    capsys.readouterr()
    for scene, outputs, said in (
        (
            "cart_pole",
            "momentm",
            "eomgen: --outputs: no output 'momentm' (did you mean 'momentum'?)",
        ),
        (
            "cart_pole",
            "momentum,",
            "eomgen: --outputs: no output ''; known: all, forward_dynamics, ",
        ),
        ("cart_pole", "jacobian", "eomgen: --outputs: 'jacobian' is always included; leave it out"),
        (
            "chain",
            "momentum,input_jacobian",
            "eomgen: chain.toml: --outputs: 'input_jacobian' needs inputs, and there are none",
        ),
    ):
        command = ["generate", scene, "--outputs", outputs, "-o", out]
        assert main(command) == 1
        assert capsys.readouterr().err.startswith(said)
    options = ["--form", "momentum", "--outputs", "mass_matrix"]
    assert main(["generate", "two_body", *options, "-o", out]) == 1
    assert "'mass_matrix' is made for form = 'velocity' only" in capsys.readouterr().err
    options = ["--outputs", "centre_of_mass", "--t-end", "0.01", "--route", "aba"]
    assert main(["simulate", "cart_pole", *options, "-o", out]) == 0
    assert "def centre_of_mass(" in target.read_text("utf-8")


def test_passes_report_what_they_save(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The report has a line for the program as lowered and one for each pass."""
    assert main(["generate", "two_body", "--report", "-o", str(tmp_path)]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[2][:2] == ["as", "lowered"] and lines[3][0] == "gather"
    assert int(lines[2][-3]) > int(lines[3][-3]) >= int(lines[4][-3])


@pytest.mark.apart
def test_progress_is_shown_on_a_terminal_and_not_in_a_pipe(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A bar on standard error if that is a terminal; a clean end; silence in a pipe."""
    asked = ["simulate", "pendulum", "-o", str(tmp_path), "--integrator", "rk4"]
    asked += ["--dt", "0.0005", "--t-end", "1", "--no-pictures"]
    command = [sys.executable, "-m", "eomgen", *asked]
    ours, theirs = pty.openpty()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs) as process:
        os.close(theirs)
        shown = b""
        while True:
            try:
                piece = os.read(ours, 4096)
            except OSError:  # the terminal's other end is closed
                break
            shown += piece
            if not piece:
                break
        process.communicate()
    os.close(ours)
    assert process.returncode == 0
    assert b"simulating pendulum" in shown and b"%" in shown
    assert main(asked) == 0
    assert capfd.readouterr().err == ""


def test_looks_and_times_are_not_derived_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another colour or end time takes the stored module; another mass does not."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path))
    text = (BUILT_IN / "pendulum.toml").read_text("utf-8")
    derived = [
        generated_code(elaborate(parse_scene(text.replace(old, new)))).derived
        for old, new in (
            ("", ""),
            ("#33658a", "#000000"),
            ("t_end = 10.0", "t_end = 1.0"),
            ("mass = 1.0", "mass = 2.0"),
        )
    ]
    assert derived == [True, False, False, True]
