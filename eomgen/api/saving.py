"""The files of a run: what `eomgen simulate` leaves in a folder."""

from pathlib import Path

from eomgen.errors import RunError
from eomgen.files import check_folder, check_writable, remove_ours
from eomgen.results import Run
from eomgen.run.trajectory import is_own_table, save_csv, save_npz

KINDS = ("py", "npz", "csv", "png", "html")


def output_paths(
    folder: Path, name: str, *, figure: Path | None = None, force: bool = False
) -> dict[str, Path]:
    """Where the files of a run go, by kind; `figure` is where the figure goes instead.

    Raises `RunError` now for what could not be written then. Folders are made.
    """
    from eomgen.show.style import check_figure

    paths = {kind: folder / f"{name}.{kind}" for kind in KINDS}
    if figure is not None:
        paths["png"] = figure
    check_figure(paths["png"], force=force)
    for kind, path in paths.items():
        check_folder(path.parent)
        own = kind == "csv" and path.is_file() and is_own_table(path)
        check_writable(path, force=force or own)
    return paths


def save_run(run: Run, paths: dict[str, Path], *, force: bool = False) -> str:
    """Write all files; return "" or, if pictures cannot be drawn, why not: their paths are then
    taken out of `paths`.
    """
    run.module.save(paths["py"], force=force)
    # The table first: the archive of an earlier run is what tells whose table it overwrites.
    save_csv(run.trajectory, paths["csv"], force=force)
    save_npz(run.trajectory, paths["npz"], force=force)
    return _save_pictures(run, paths, force)


def _save_pictures(run: Run, paths: dict[str, Path], force: bool) -> str:
    """Write figure and page; return "" or, if they cannot be drawn, why not."""
    from eomgen.show.figure import save_figure
    from eomgen.show.page import save_page

    parameters = tuple(run.model.defaults.values())
    try:
        save_figure(run.motion, paths["png"], force=force)
        save_page(run.motion, run.module.poses, parameters, paths["html"], force=force)
    except (RunError, KeyboardInterrupt) as error:
        # Pictures of an earlier run must not stand beside the numbers of this one.
        for kind in ("png", "html"):
            remove_ours(paths.pop(kind))
        if isinstance(error, KeyboardInterrupt):
            raise
        return str(error)
    return ""
