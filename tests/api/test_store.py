"""The store attacked: whatever lies in it, only what this program wrote for this scene is used."""

import builtins
import errno
import hashlib
import json
import marshal
import os
import pickle
import random
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from campaign import some

import eomgen
import eomgen.base.entries
from eomgen import store
from eomgen.base.entries import LARGEST, LONGEST_UNUSED, LONGEST_WRITING, Entries
from eomgen.commands.main import main
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.native import library
from eomgen.pipeline import generate
from eomgen.run.module import load_module
from eomgen.scene.reader import BUILT_IN, parse_scene, read_scene
from eomgen.show.figure import draw_motion as DRAWN
from eomgen.study.accuracy.reference import reference

KEY = "0123456789abcdef" * 2
OTHER = KEY[::-1]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A store of this test's own, which is not there yet."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path / "store"))
    return tmp_path / "store"


def model_of(name: str) -> Model:
    return elaborate(read_scene(name))


def entry_of(folder: Path, name: str) -> Path:
    return folder / f"{store.key_of(model_of(name))}.entry"


def signed(path: Path, content: bytes) -> None:
    """Write an entry as `put` would: with the digest of its key and its content."""
    key = path.stem
    digest = hashlib.sha256(f"{key}\n".encode() + content).hexdigest()
    path.write_bytes(f"eomgen entry 1 {key} {digest}\n".encode() + content)


def wrong(path: Path) -> None:
    """One per cent of wrong physics, and the digest recomputed: only its owner could do that."""
    head, _, content = path.read_bytes().partition(b"\n")
    assert b"gravity_g" in content and head.startswith(b"eomgen entry 1 ")
    signed(path, content.replace(b"9.81", b"9.91"))


def generated(tmp_path: Path, name: str = "pendulum") -> bytes:
    """The module that `generate` writes."""
    out = tmp_path / "out"
    assert main(["generate", name, "-o", str(out), "--force"]) == 0
    return (out / f"{name}.py").read_bytes()


RIGHT = (Path(__file__).parent.parent.parent / "generated" / "pendulum.py").read_bytes()


def test_the_store_is_the_users_own(folder: Path, tmp_path: Path) -> None:
    """Made with mode 0700, entries 0600, whatever the mask; and it is used."""
    before = os.umask(0)
    try:
        assert generated(tmp_path) == RIGHT
    finally:
        os.umask(before)
    assert folder.stat().st_mode & 0o777 == 0o700
    entry = entry_of(folder, "pendulum")
    assert entry in [*folder.iterdir()]
    assert [path.stat().st_mode & 0o777 for path in folder.glob("*.entry")] == [0o600] * 3
    wrong(entry)  # which only the owner can, who could change this program as well
    assert b"9.91" in generated(tmp_path)


def test_an_entry_under_another_key_is_not_used(folder: Path, tmp_path: Path) -> None:
    """`simulate pendulum` does not become cart_pole by a copy, with or without its key's name."""
    generated(tmp_path, "cart_pole")
    theirs, ours = entry_of(folder, "cart_pole"), entry_of(folder, "pendulum")
    content = theirs.read_bytes()
    for copied in (content, content.replace(theirs.stem.encode(), ours.stem.encode())):
        ours.write_bytes(copied)
        ours.chmod(0o600)
        assert generated(tmp_path) == RIGHT
        assert ours.read_bytes() != copied, "it was put right"


def test_check_derives_anew(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Wrong physics in the store passes no `generate --check`, and is put right with a notice."""
    generated(tmp_path)
    entry = entry_of(folder, "pendulum")
    whole = entry.read_bytes()
    wrong(entry)
    capsys.readouterr()
    out = tmp_path / "out"
    assert main(["generate", "pendulum", "--check", "-o", str(out)]) == 0
    assert capsys.readouterr().err == (
        f"eomgen: note: the store {folder} held other code for this scene, which was replaced\n"
    )
    assert entry.read_bytes() == whole
    wrong(entry)
    (out / "pendulum.py").write_bytes(RIGHT.replace(b"9.81", b"9.91"))
    assert main(["generate", "pendulum", "--check", "-o", str(out)]) == 1


def _writable(folder: Path) -> None:
    folder.chmod(0o770)


def _writable_by_all(folder: Path) -> None:
    folder.chmod(0o1777)


def _link(folder: Path) -> None:
    folder.rename(folder.with_name("elsewhere"))
    folder.symlink_to(folder.with_name("elsewhere"))


def _file(folder: Path) -> None:
    folder.rename(folder.with_name("elsewhere"))
    folder.write_bytes(b"")


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (_writable, "others can write to it; run: chmod go-w {folder}"),
        (_writable_by_all, "others can write to it; run: chmod go-w {folder}"),
        (_link, "it is a symbolic link; name the folder itself in EOMGEN_CACHE"),
        (_file, "it is not a folder; name one in EOMGEN_CACHE"),
    ],
)
def test_a_folder_that_others_may_have_written_to_is_done_without(
    folder: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    changed: Callable[[Path], None],
    said: str,
) -> None:
    """Nothing of it is run, nothing is put there, and one line says why."""
    generated(tmp_path)
    wrong(entry_of(folder, "pendulum"))
    changed(folder)
    held = sorted(folder.iterdir()) if folder.is_dir() else []
    out = str(tmp_path / "made")
    capsys.readouterr()
    assert main(["generate", "pendulum", "-o", out]) == 0
    words = said.format(folder=folder)
    assert capsys.readouterr().err == f"eomgen: note: the store {folder} is not used: {words}\n"
    assert (tmp_path / "made" / "pendulum.py").read_bytes() == RIGHT
    assert (sorted(folder.iterdir()) if folder.is_dir() else []) == held


@pytest.mark.parametrize("changed", [_writable, _link, None])
def test_no_machine_code_comes_from_a_store_that_is_not_used(
    folder: Path, monkeypatch: pytest.MonkeyPatch, changed: Callable[[Path], None] | None
) -> None:
    """It lies in a folder of its own, which is as private as before when the store is not."""
    loaded: list[bytes] = []
    monkeypatch.setattr(library, "_key", lambda about: KEY)
    monkeypatch.setattr(library, "_loaded", loaded.append)
    folder.mkdir(mode=0o700)
    Entries(folder / "native").put(KEY, b"code")
    library.kept_library("")
    assert loaded == [b"code"]
    if changed is not None:
        changed(folder)
    else:
        asked = Path.lstat

        def lstat(path: Path) -> os.stat_result:
            about = asked(path)
            return os.stat_result((*about[:4], about.st_uid + (path == folder), *about[5:]))

        monkeypatch.setattr(Path, "lstat", lstat)
    assert library.kept_library("") is None and loaded == [b"code"]


def test_what_belongs_to_another_user_is_not_used(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Neither a folder, as of one who makes it first in /tmp, nor an entry in the user's own."""
    generated(tmp_path)
    entry = entry_of(folder, "pendulum")
    wrong(entry)
    theirs, asked = os.geteuid() + 1, os.fstat

    def fstat(handle: int) -> os.stat_result:
        about = asked(handle)
        return os.stat_result((*about[:4], theirs, *about[5:]))

    monkeypatch.setattr(eomgen.base.entries.os, "fstat", fstat)
    assert Entries(folder).get(entry.stem) is None
    assert generated(tmp_path) == RIGHT
    monkeypatch.undo()
    monkeypatch.setenv("EOMGEN_CACHE", str(folder))
    wrong(entry)
    monkeypatch.setattr(eomgen.base.entries.os, "geteuid", lambda: theirs)
    assert generated(tmp_path) == RIGHT
    assert "it belongs to another user; name a folder of your own in" in capsys.readouterr().err


def _fifo(path: Path) -> None:
    os.mkfifo(path)


def _endless(path: Path) -> None:
    path.symlink_to("/dev/zero")


def _sparse(path: Path) -> None:
    path.write_bytes(b"eomgen entry 1 ")
    os.truncate(path, 2**40)


def _a_folder(path: Path) -> None:
    path.mkdir()


def _linked(path: Path) -> None:
    generate_entry(path)
    path.symlink_to(path.rename(path.with_name("aside")))


def generate_entry(path: Path) -> None:
    signed(path, json.dumps(["print('run')", "", [], []]).encode())


def _group_writable(path: Path) -> None:
    generate_entry(path)
    path.chmod(0o620)


def _nested(path: Path) -> None:
    signed(path, b"[" * 1_000_000)


def _long_number(path: Path) -> None:
    signed(path, b"[" + b"9" * 5000 + b"]")


def _half_a_pair(path: Path) -> None:
    signed(path, json.dumps(["\ud800", "", [], []]).encode())


ATTACKS = (
    *(_fifo, _endless, _sparse, _a_folder, _linked, _group_writable),
    *(_nested, _long_number, _half_a_pair),
)


@pytest.mark.parametrize("attack", ATTACKS)
def test_what_is_no_entry_is_not_read(
    folder: Path, tmp_path: Path, attack: Callable[[Path], None]
) -> None:
    """No hang, no gigabytes, no traceback, nothing run: it is derived anew, and put right."""
    folder.mkdir(mode=0o700)
    entry = entry_of(folder, "pendulum")
    attack(entry)
    began = time.monotonic()
    assert generated(tmp_path) == RIGHT
    assert time.monotonic() - began < 300
    if attack is not _a_folder:
        assert store.generated_code(model_of("pendulum")).derived is False


def _mangled(value: Any, r: random.Random) -> Any:
    """A value with something in it replaced by something else."""
    if r.random() < 0.2 or not isinstance(value, list) or not value:
        odd = (None, True, -1, 1.5, "", "x", "\ud800", [], {}, [[]], {"a": 1}, 10**30, [1, 2, 3, 4])
        return r.choice(odd)
    changed = list(value)
    at = r.randrange(len(changed))
    match r.randrange(3):
        case 0:
            del changed[at]
        case 1:
            changed.insert(at, _mangled(changed[at], r))
        case _:
            changed[at] = _mangled(changed[at], r)
    return changed


def test_malformed_entries_are_none() -> None:
    """Whatever the JSON, with the right digest: code of the right types, or None."""
    code = store.generated_code(model_of("pendulum"))
    whole = store._content(code)
    again = store._code(whole)
    assert again is not None and again.module == code.module and again.reports == code.reports
    parts, r = json.loads(whole), random.Random(16)
    taken = 0
    for number in range(some(3000, 300_000)):
        mangled = parts
        for _ in range(r.choice((1, 1, 2, 3))):
            mangled = _mangled(mangled, r)
        text = json.dumps(mangled).encode()
        if number % 3 == 0:  # and not even JSON
            at = r.randrange(len(text))
            text = text[:at] + bytes(r.randrange(256) for _ in range(r.randrange(3))) + text[at:]
        found = store._code(text)
        if found is None:
            continue
        taken += 1
        assert isinstance(found.module, str)
        (found.module + "".join(found.explanation)).encode()
        for line in found.reports:
            assert isinstance(line.name, str)
            assert {type(n) for n in (line.steps, line.derivative, line.jacobian)} == {int}
    assert taken > 50


def test_a_malformed_program_is_recorded_again(folder: Path) -> None:
    """Whatever its entry holds, with the right digest."""
    model = model_of("pendulum")
    right = store.program_of(model)
    path = folder / f"{store._program_key(store.key_of(model))}.entry"
    whole = path.read_bytes().partition(b"\n")[2]
    odd = (b"", b"x", b"cnowhere\nclass\n.", pickle.dumps(3), pickle.dumps(("{}", None)))
    r = random.Random(3)
    cut = [whole[: r.randrange(len(whole))] for _ in range(some(3, 100))]
    flips = [
        bytes(b ^ (i == at) for i, b in enumerate(whole))
        for at in r.sample(range(900), some(4, 200))
    ]
    for content in flips:  # some are programs, if other ones; none is an error
        signed(path, content)
        assert store.program_of(model).outputs
    for content in (*odd, *cut):
        signed(path, content)
        assert store.program_of(model).steps == right.steps
    assert path.read_bytes().partition(b"\n")[2] == whole


@pytest.mark.apart
def test_writers_at_once(tmp_path: Path) -> None:
    """Processes that put and get at once find nothing, or what one of them wrote; nothing is left
    behind.
    """
    code = (
        "import sys; from pathlib import Path; from eomgen.base.entries import Entries\n"
        "entries, byte = Entries(Path(sys.argv[1])), bytes([int(sys.argv[2])])\n"
        "for _ in range(100):\n"
        f"    assert entries.put({KEY!r}, byte * 100_000) == ''\n"
        f"    found = entries.get({KEY!r})\n"
        "    assert found and len(found) == 100_000 and len(set(found)) == 1\n"
    )
    entries = Entries(tmp_path / "store")
    command = [sys.executable, "-c", code, str(entries.folder)]
    writers = [subprocess.Popen([*command, str(n)]) for n in range(1, 4)]
    assert [writer.wait() for writer in writers] == [0] * 3
    assert [path.name for path in entries.folder.iterdir()] == [f"{KEY}.entry"]


def test_a_killed_writer_leaves_the_store_sound(tmp_path: Path) -> None:
    """Killed while it writes; what it had begun goes after an hour, and not before."""
    entries = Entries(tmp_path / "store")
    assert entries.put(KEY, b"whole") == ""
    code = (
        "import sys; from pathlib import Path; from eomgen.base.entries import Entries\n"
        "entries = Entries(Path(sys.argv[1])); print(flush=True)\n"
        f"while True: entries.put({KEY!r}, b'x' * 30_000_000)"
    )
    for pause in (0.01, 0.03, 0.07):
        command = [sys.executable, "-c", code, str(entries.folder)]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as writer:
            assert writer.stdout is not None
            writer.stdout.readline()
            time.sleep(pause)
            writer.kill()
        found = entries.get(KEY)
        assert found in (b"whole", b"x" * 30_000_000)
    begun = tmp_path / "store" / f"{KEY}.{'0' * 16}.begun"
    begun.write_bytes(b"half")
    assert entries.put(KEY, b"new") == "" and begun.exists()
    ago = time.time() - LONGEST_WRITING - 10
    for path in entries.folder.glob("*.begun"):
        os.utime(path, (ago, ago))
    assert entries.put(KEY, b"new") == "" and entries.get(KEY) == b"new"
    assert [path.name for path in entries.folder.iterdir()] == [f"{KEY}.entry"]


def test_a_full_disk_leaves_the_store_sound(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """What cannot be written is done without, with a notice; nothing half is left behind."""
    generated(tmp_path)
    before = sorted((path, path.read_bytes()) for path in folder.iterdir())
    opened = os.fdopen

    def full(handle: int, mode: str) -> Any:
        if "w" not in mode:
            return opened(handle, mode)
        os.close(handle)
        return Path("/dev/full").open(mode, buffering=0)

    monkeypatch.setattr(eomgen.base.entries.os, "fdopen", full)
    capsys.readouterr()
    monkeypatch.setattr("eomgen.base.files.write_whole", None)
    assert store.generated_code(model_of("two_body")).notice == (
        f"the store {folder} is not used: it cannot be written: {os.strerror(errno.ENOSPC)}"
    )
    assert sorted((path, path.read_bytes()) for path in folder.iterdir()) == before


def test_a_store_that_cannot_be_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Below a file, with a name too long, or without a home: done without, and said."""
    (tmp_path / "file").write_bytes(b"")
    for place, why in (
        (tmp_path / "file" / "store", os.strerror(errno.ENOTDIR)),
        (tmp_path / ("n" * 300), os.strerror(errno.ENAMETOOLONG)),
    ):
        monkeypatch.setenv("EOMGEN_CACHE", str(place))
        assert generated(tmp_path) == RIGHT
        assert capsys.readouterr().err.endswith(f"is not used: it cannot be read: {why}\n")
    monkeypatch.setenv("EOMGEN_CACHE", "~nobody_of_this_name/store")
    assert generated(tmp_path) == RIGHT
    assert "note: no store: there is no home folder" in capsys.readouterr().err
    assert not list(Path.cwd().glob("~*"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("EOMGEN_CACHE", "relative")
    assert generated(tmp_path) == RIGHT
    made = list((tmp_path / "relative").glob("*.entry"))
    assert len(made) == 3, "the code, its bytecode and its program"


def test_old_entries_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By last use: what nobody used for long, then whatever is beyond the size; the newest stay."""
    entries, now = Entries(tmp_path / "store"), time.time()
    keys = [f"{n:032x}" for n in range(6)]
    for age, key in enumerate(keys):
        assert entries.put(key, b"x" * 1000) == ""
        when = now - 86400 * age
        os.utime(entries.folder / f"{key}.entry", (when, when))
    when = now - LONGEST_UNUSED - 100
    os.utime(entries.folder / f"{keys[1]}.entry", (when, when))
    assert entries.get(keys[5]) is not None, "which uses it"
    strangers = ["notes.txt", f"{'f' * 32}.entry", f"{'e' * 32}.json", f"{KEY}.entry.begun"]
    for name in strangers:
        (entries.folder / name).write_bytes(b"mine" * 1000)
        os.utime(entries.folder / name, (1.0, 1.0))
    (entries.folder / f"{'d' * 32}.entry").mkdir()
    (entries.folder / f"{'c' * 32}.entry").symlink_to(entries.folder / "notes.txt")
    strangers += [f"{letter * 32}.entry" for letter in "cd"]

    def kept() -> list[str]:
        names = {path.name for path in entries.folder.iterdir()}
        assert names >= set(strangers), "what it did not write stays"
        return sorted(name.partition(".")[0] for name in names - set(strangers))

    assert entries.put(OTHER, b"x") == ""
    assert kept() == sorted([*keys[:1], *keys[2:], OTHER])
    monkeypatch.setattr(eomgen.base.entries, "MOST_BYTES", 3000)
    assert entries.put(OTHER, b"x") == ""
    assert kept() == sorted([keys[0], keys[5], OTHER]), "the last used ones"


def test_what_is_too_large_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And is no trouble: it is derived each time."""
    monkeypatch.setattr(eomgen.base.entries, "LARGEST", 1000)
    entries = Entries(tmp_path / "store")
    assert entries.put(KEY, b"x" * 1000) == "" and entries.get(KEY) is None
    assert entries.put(KEY, b"x" * 500) == "" and entries.get(KEY) == b"x" * 500
    assert LARGEST > 72_063_948, "a thousand links with all outputs"


@pytest.mark.apart
def test_the_key_names_all_that_shapes_the_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each library that is loaded to generate code, each such file of this program, and Python."""
    code = (
        "import sys; before = set(sys.modules)\n"
        "from eomgen.model.elaborate import elaborate; from eomgen.pipeline import generate\n"
        "from eomgen.scene.reader import read_scene\n"
        "for name in ('two_body', 'spinning_top', 'bouncing_two_body'):\n"
        "    generate(elaborate(read_scene(name)))\n"
        "print(*(set(sys.modules) - before))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules = done.stdout.split()
    tops = {m.partition(".")[0] for m in modules} - sys.stdlib_module_names - {"eomgen"}
    types_alone = {"annotated_types", "typing_extensions", "typing_inspection"}
    assert {t for t in tops if not t.startswith("_")} - types_alone == set(store.LIBRARIES)
    sources = {path.relative_to(store.PACKAGE).with_suffix("") for path in store._sources()}
    ours = [Path(*m.split(".")[1:]) for m in modules if m.startswith("eomgen.")]
    assert {path for path in ours if {path, path / "__init__"} & sources} == set(ours)
    digest = store._generator_digest.__wrapped__
    before = digest()
    version = store.importlib.metadata.version
    for name in store.LIBRARIES:
        with monkeypatch.context() as patch:
            patch.setattr(
                store.importlib.metadata,
                "version",
                lambda asked, name=name: version(asked) + ".1" * (asked == name),
            )
            assert digest() != before, name
    monkeypatch.setattr(store.platform, "python_version", lambda: "3.99.0")
    assert digest() != before


def test_every_file_is_in_the_key_of_compiled_code() -> None:
    """Whatever may be printed into it: no list of them by hand is whole for long."""
    code = (
        "from pathlib import Path; read, once = [], Path.read_bytes\n"
        "Path.read_bytes = lambda path: (read.append(path), once(path))[1]\n"
        "from eomgen.model.elaborate import elaborate; from eomgen.scene.reader import read_scene\n"
        "from eomgen.native.accelerator import library_key\n"
        "library_key(elaborate(read_scene('pendulum'))); print(*read, sep='\\n')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    templates = (store.templates_folder() / "c").rglob("*.jinja")
    missed = {*store.PACKAGE.rglob("*.py"), *templates} - {*map(Path, done.stdout.splitlines())}
    assert not missed


def test_every_number_of_a_model_is_in_its_key() -> None:
    """Change any value of a scene by its last digit: the key is another."""
    text = (BUILT_IN / "spinning_top.toml").read_text("utf-8")
    key = store.key_of(elaborate(parse_scene(text)))
    changed = text.replace("9.81", "9.8100000000000005")
    assert text != changed and 9.81 == 9.8100000000000005
    assert store.key_of(elaborate(parse_scene(changed))) == key
    changed = text.replace("9.81", "9.810000000000002")
    assert store.key_of(elaborate(parse_scene(changed))) != key
    assert generate(model_of("pendulum")).module.encode() == RIGHT


def test_references_are_kept_as_safely(folder: Path, tmp_path: Path) -> None:
    """One under another key, one that others could have written, a pipe: computed anew."""
    module = load_module(generate(model_of("pendulum")).module)
    place = folder / "references"

    def made(t_end: float) -> Any:
        return reference(None, module, t_end=t_end, folder=place, seconds=0.0)

    short, other = made(0.1), made(0.2)
    assert place.stat().st_mode & 0o777 == 0o700
    paths = sorted(place.iterdir(), key=lambda path: path.stat().st_mtime)
    assert len(paths) == 2
    paths[0].write_bytes(paths[1].read_bytes())
    assert made(0.1).t[-1] == short.t[-1] != other.t[-1]
    paths[0].unlink()
    os.mkfifo(paths[0])
    assert made(0.1).t[-1] == short.t[-1] and paths[0].is_file()
    place.chmod(0o777)
    for path in paths:
        path.write_bytes(b"")
    assert made(0.1).t[-1] == short.t[-1]
    assert [path.read_bytes() for path in paths] == [b"", b""]


def test_a_warm_run_computes_only_what_is_asked_for(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No view of a picture, no module compiled by Python, and one digest of the model."""
    asked: dict[str, Any] = {"t_end": 0.1, "backend": "numpy"}
    before = eomgen.simulate("cart_pole", **asked)
    digest, counts = Model.__dict__["digest"], Counter[str]()
    compiling, digesting = builtins.compile, digest.func

    def compiles(source: Any, *given: Any, **named: Any) -> Any:
        counts["compile"] += "def derivative(" in str(source)
        return compiling(source, *given, **named)

    def digests(model: Model) -> bytes:
        counts["digest"] += 1
        return bytes(digesting(model))

    def frames(*_: Any) -> None:
        counts["view"] += 1
        raise AssertionError("asked for")

    monkeypatch.setattr(builtins, "compile", compiles)
    monkeypatch.setattr(digest, "func", digests)
    monkeypatch.setattr("eomgen.show.framing.bounds_of", frames)
    monkeypatch.setattr("eomgen.show.figure.draw_motion", DRAWN)
    run = eomgen.simulate("cart_pole", **asked)
    assert counts == {"compile": 0, "digest": 1}
    assert run.y.tobytes() == before.y.tobytes()
    with pytest.raises(AssertionError, match="asked for"):
        run.figure()


@pytest.mark.parametrize("content", [b"", b"no bytecode", marshal.dumps((1, "x"))])
def test_an_entry_that_is_no_bytecode_is_compiled_anew(content: bytes, folder: Path) -> None:
    """Also one with the right digest, which only this user could write."""
    source = "x = 1 + 1\n"
    store.bytecode_of(source)
    (entry,) = folder.iterdir()
    right = entry.read_bytes()
    signed(entry, content)
    names: dict[str, Any] = {}
    exec(store.bytecode_of(source), names)
    assert names["x"] == 2 and entry.read_bytes() == right
