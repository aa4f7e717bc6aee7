"""The lists of docs/architecture.md are the whole recipe: what a package adds in `tests/plugin` is
put into a copy of this one by hand, file by file as they say, and every command takes it.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
OURS = ROOT / "tests" / "plugin" / "eomgen_example"
TREE = (ROOT / "tests" / "plugin" / "boat.toml").read_text("utf-8").replace(
    "bodies = [", 'outputs = ["energy_again"]\nbodies = [', 1
) + "simulation = { t_end = 0.2 }\n"
LOOP = (
    TREE.replace("boat", "tram")
    .replace("telescope", "planar")
    .replace(
        "effects = [",
        'constraints = [{ type = "level", name = "rail", body = "hull", height = 0 }]\neffects = [',
    )
)
SCENE = "eomgen/scene/"
AGAIN = 'OutputSpec((), "Kinetic energy again, J.", "observed:energy_again", units=("J",))'
EDITS = {
    "a joint": {
        f"{SCENE}joints/telescope.py": OURS / "joints.py",
        f"{SCENE}joints/__init__.py": [
            (
                "from eomgen.scene.joints.weld",
                "from eomgen.scene.joints.telescope import Telescope",
            ),
            ("    Ball | Cylindrical", "    Telescope |"),
        ],
    },
    "an effect": {
        f"{SCENE}effects/buoyancy.py": OURS / "effects.py",
        f"{SCENE}effects/__init__.py": [
            ("from eomgen.scene.effects.con", "from eomgen.scene.effects.buoyancy import Buoyancy"),
            ("    Gravity\n    |", "    Buoyancy |"),
        ],
    },
    "a constraint": {
        f"{SCENE}constraints/level.py": OURS / "constraints.py",
        f"{SCENE}constraints/__init__.py": [
            ("from eomgen.scene.constraints.k", "from eomgen.scene.constraints.level import Level"),
            ("    Belt | Coup", "    Level |"),
        ],
    },
    "an output": {
        "eomgen/tables/outputs.py": [('    "kinetic_slopes": ', f'    "energy_again": {AGAIN},')],
        "eomgen/codegen/observed.py": [
            ("def coordinates(", "energy_again = lambda r: [r.dynamics.kinetic_energy]")
        ],
    },
    "a route": {
        "eomgen/tables/routes.py": [
            ('    "aba": ', '    "twin": RouteSpec("as aba", "articulated", trees=True),')
        ]
    },
    "a backend": {
        "eomgen/codegen/backends/listing.py": OURS / "listing.py",
        "eomgen/codegen/backends/__init__.py": [
            ("from eomgen.codegen.backends im", "from eomgen.codegen.backends import listing"),
            ('    "c": c', '    "listing": listing,'),
        ],
    },
    "an integrator": {
        "eomgen/run/integrators/heun.py": OURS / "methods.py",
        "eomgen/tables/integrators.py": [
            ('    "euler": ', '    "heun": IntegratorSpec("Heun", "explicit", "heun:HEUN"),')
        ],
    },
    "an option": {
        "eomgen/api/options.py": [
            (
                "    works: bool = op",
                '    laps: int = option(1, "laps that are run", check=at_most(9))',
            )
        ],
    },
}
"""Of each thing to add the files to touch: a new one, or which line to write before which words."""
FEW = ["check boat.toml", "list", "generate boat.toml --backend listing -o out"]
COMMANDS = [
    "check tram.toml", "schema", "reference buoyancy", "derive boat.toml", "derive tram.toml",
    "generate boat.toml --route twin -o out", "generate tram.toml -o out",
    *(f"simulate {name}.toml --integrator heun --dt 0.01 -o out" for name in ("boat", "tram")),
    "verify boat.toml --states 1", "verify tram.toml --states 1", "effects boat.toml -o out",
    "plot boat.toml -o out/boat.svg", "film boat.toml -o out/boat.gif",
    "linearise boat.toml --at initial", "sweep boat.toml --vary foot_angle=0.1,0.2 -o swept",
    "accuracy boat.toml --quick --methods heun,DOP853 --no-arithmetic -o out",
    "export boat.toml --matlab -o out/matlab", "gallery --scene boat.toml -o all",
]  # fmt: skip
RUN = """
import sys
from eomgen.commands.main import main
for line in sys.argv[1:]:
    code = main(line.split())
    assert code == 0, (line, code)
"""


def lists() -> dict[str, str]:
    """The recipes of the page, by their headings."""
    page = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    parts = re.split(
        r"^\*\*(an? [\w ]+)\*\*$", page.partition("## How to add")[2], flags=re.MULTILINE
    )
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@pytest.mark.parametrize("what", EDITS)
def test_the_lists_name_the_files(what: str) -> None:
    """Those that are touched below, at most two by hand, and no other is needed."""
    said = lists()[what]
    assert len(EDITS[what]) <= 2
    for path in EDITS[what]:
        new = not (ROOT / path).exists()
        named = f"{path.rpartition('/')[0]}/NAME.py" if new else path
        assert named.removeprefix("eomgen/") in said, path


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package with one of each added, and two scenes that use them."""
    root = tmp_path_factory.mktemp("house")
    for name in ("eomgen", "templates"):
        shutil.copytree(ROOT / name, root / name)
    for edits in EDITS.values():
        for path, change in edits.items():
            if isinstance(change, Path):
                shutil.copyfile(change, root / path)
                continue
            text = (root / path).read_text("utf-8")
            for before, words in change:
                assert before in text, (path, before)
                text = text.replace(before, f"{words}\n{before}", 1)
            (root / path).write_text(text, "utf-8")
    for text in (TREE, LOOP):
        (root / f"{text.split(chr(34))[1]}.toml").write_text(text, "utf-8")
    return root


def used(house: Path, *words: str | Path) -> str:
    """What Python prints in the folder of the copy, with the copy for eomgen."""
    env = {**os.environ, "PYTHONPATH": str(house), "EOMGEN_CACHE": str(house / "cache")}
    command = [sys.executable, *words]
    done = subprocess.run(command, cwd=house, env=env, capture_output=True, text=True)
    assert not done.returncode, done.stdout + done.stderr
    return done.stdout


@pytest.mark.apart
def test_what_is_added_by_hand_is_ours(house: Path) -> None:
    """A few commands take it; in full runs all do."""
    said = used(house, "-c", RUN, *FEW)
    assert "telescope" in said and "buoyancy" in said
    assert (house / "out" / "boat.txt").read_text("utf-8").splitlines()[1] == "sea_up m"


ASKED = """
import sys
import eomgen, pages
from eomgen.commands.main import main
assert eomgen.simulate("boat.toml", t_end=0.01, laps=2).finished
try:
    eomgen.simulate("boat.toml", laps=12)
except eomgen.RunError as error:
    print(error)
lines = map(str.split, eomgen.simulate.__doc__.splitlines())
assert any(words[:5] == "laps laps that are run".split() for words in lines)
assert "laps=1" in pages.functions_page()
assert "| `--laps N` | laps that are run |" in pages.commands_page()
for line in ("simulate boat.toml --t-end 0.01 --laps 2 -o out", "completion bash"):
    assert main(line.split()) == 0
assert main("simulate boat.toml --laps 12 -o out".split()) == 1
"""


@pytest.mark.apart
def test_an_option_is_one_entry(house: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The functions, the commands, their completion, messages and the reference have it."""
    monkeypatch.setenv("TOOLS", str(ROOT / "tools"))
    said = used(house, "-c", f"import os, sys; sys.path.append(os.environ['TOOLS'])\n{ASKED}")
    assert "laps: 12 is not a number from 1 to 9" in said and "--laps" in said


@pytest.mark.full
def test_every_command_takes_it(house: Path) -> None:
    """The rest of them; and the house is in order once its schema is written anew."""
    assert "water" in used(house, "-c", RUN, *COMMANDS)
    schema = used(house, "-m", "eomgen", "schema")
    (house / "eomgen" / "scenes" / "scene.schema.json").write_text(schema, "utf-8")
    tests = ROOT / "tests" / "project" / "test_architecture.py"
    used(
        house,
        "-m",
        "pytest",
        "-q",
        "-n0",
        tests,
        "-p",
        "no:cacheprovider",
        "-k",
        "fact or way or cycle or tables or fit",
    )
