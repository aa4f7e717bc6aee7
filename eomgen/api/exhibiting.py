"""A folder with the live pages of many scenes, and a first page that leads to them: `gallery`."""

import time
from collections.abc import Callable, Iterable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from eomgen.api.given import Source, read
from eomgen.api.options import RunOptions
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.api.runs import Run
from eomgen.api.simulating import plan_of, run_plan
from eomgen.base.errors import RunError
from eomgen.base.files import check_folder, check_writable, write_whole
from eomgen.scene.built_in import built_in_names
from eomgen.scene.schema import Scene
from eomgen.show.gallery import Exhibit, gallery_page, thumbnail
from eomgen.show.page import save_page

INDEX = "index.html"
BASE = 3.0
"""What a scene without bodies would take to be shown, in bodies."""


@public
def gallery(
    folder: str | PathLike[str],
    scenes: Sequence[Source] | None = None,
    *,
    live: bool | None = None,
    force: bool = False,
    **options: Any,
) -> Path:
    """Write the page of each scene into a folder, and `index.html`, which shows them all: of each
    a picture, the title, and the sentence `about`. Return the path of `index.html`.

    scenes   as `simulate` takes them; None: all built-in ones
    live     as `Run.page` takes it: None for live pages where that is possible
    force    also overwrite files that this program did not write
    options  of `simulate`, for all scenes: t_end, integrator, rtol, samples, …

    The pages of scenes that are done are kept, and in the index, if a later one fails or an
    interrupt comes. Raises `SceneError` or `RunError` as `simulate` does, and `RunError` if a file
    cannot be written.
    """
    chosen = chosen_scenes(built_in_names() if scenes is None else scenes)
    paths = gallery_paths(Path(folder), chosen, force=force)
    done: list[Exhibit] = []
    try:
        for scene in chosen:
            wanted = RunOptions(scene, **options)
            done += [exhibited(scene, wanted, paths[scene.name], live=live, force=force)]
    finally:
        save_index(paths[""], done, force=force)
    return paths[""]


def chosen_scenes(sources: Iterable[Source]) -> tuple[Scene, ...]:
    """The scenes, read. Raises `SceneError`, or `RunError` for two of the same name."""
    scenes = tuple(map(read, sources))
    names = [scene.name.casefold() for scene in scenes]  # as some file systems compare them
    for name in names:
        if names.count(name) > 1:
            raise RunError(f"gallery: two scenes are named '{name}'; rename or leave out one")
        if f"{name}.html" == INDEX:
            raise RunError(f"gallery: a scene is named '{name}', as the first page is; rename it")
    return scenes


def gallery_paths(folder: Path, scenes: Sequence[Scene], *, force: bool = False) -> dict[str, Path]:
    """The path of each scene's page by its name, and that of the first page, "". Makes the folder.

    Raises `RunError` for a path that cannot be written.
    """
    paths = {"": folder / INDEX} | {s.name: folder / f"{s.name}.html" for s in scenes}
    check_folder(folder)
    for path in paths.values():
        check_writable(path, force=force)
    return paths


def exhibited(
    scene: Scene,
    options: RunOptions,
    path: Path,
    *,
    live: bool | None = None,
    force: bool = False,
    reporter: Reporter = SILENT,
) -> Exhibit:
    """Simulate a scene as `options` say, and write its page. Raises as `simulate` does, and
    `KeyboardInterrupt` if an interrupt ended the run, which then is not shown.
    """
    run = run_plan(plan_of(options, reporter), reporter=reporter)
    if run.outcome.kind == "interrupted":
        raise KeyboardInterrupt
    with reporter.waiting(f"writing {scene.name} …"):
        return exhibit_of(run, scene.about, path, live=live, force=force)


def exhibit_of(
    run: Run, about: str, path: Path, *, live: bool | None = None, force: bool = False
) -> Exhibit:
    """Write the page of a run. Raises `RunError` if it cannot be drawn or written."""
    code, motion = run.page(live=live), run.motion
    picture = thumbnail(motion)
    save_page(motion, code, path, force=force)
    return Exhibit(
        name=run.model.name,
        title=motion.heading,
        about=about,
        page=path.name,
        size=path.stat().st_size,
        picture=picture,
        live=code.live,
        stopped=motion.stopped,
    )


def save_index(path: Path, exhibits: Sequence[Exhibit], *, force: bool = False) -> None:
    """Write the first page of a gallery, unless there is nothing to show."""
    if exhibits:
        write_whole(path, gallery_page(exhibits), force=force)


def forecast(scenes: Sequence[Scene]) -> Callable[[int], float]:
    """A function of the number of scenes that are done: about how long the others take, s, by the
    time passed since this call and the numbers of bodies.
    """
    began = time.monotonic()
    sizes = [BASE + len(s.bodies) + sum(chain.count for chain in s.chains) for s in scenes]

    def left(done: int) -> float:
        return (time.monotonic() - began) * sum(sizes[done:]) / sum(sizes[:done])

    return left
