"""The files that `eomgen simulate` writes into a folder."""

from pathlib import Path

from eomgen.errors import RunError
from eomgen.files import check_folder, check_writable, remove_ours
from eomgen.results import Run
from eomgen.run.trajectory import is_own_table, save_csv, save_npz

KINDS = ("py", "npz", "csv", "png", "html")


def output_paths(
    folder: Path, name: str, *, figure: Path | None = None, force: bool = False
) -> dict[str, Path]:
    """The paths of the files of a run, by kind; `figure` replaces the path of the figure.

    Makes the folders. Raises `RunError` for a path that cannot be written, before the run begins.
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
    """Write all files. If figure and page cannot be drawn, remove their paths from `paths` and
    return why; otherwise return "".
    """
    run.module.save(paths["py"], force=force)
    # The table first: the archive of the earlier run shows whether its table is ours to overwrite.
    save_csv(run.trajectory, paths["csv"], force=force)
    save_npz(run.trajectory, paths["npz"], force=force)
    return _save_pictures(run, paths, force)


def _save_pictures(run: Run, paths: dict[str, Path], force: bool) -> str:
    """Write figure and page; return why they cannot be drawn, or ""."""
    from eomgen.show.figure import save_figure
    from eomgen.show.page import save_page

    parameters = tuple(run.model.defaults.values())
    try:
        save_figure(run.motion, paths["png"], force=force)
        save_page(run.motion, run.module.poses, parameters, paths["html"], force=force)
    except (RunError, KeyboardInterrupt) as error:
        # Figure and page of an earlier run do not belong to the new numbers.
        for kind in ("png", "html"):
            remove_ours(paths.pop(kind))
        if isinstance(error, KeyboardInterrupt):
            raise
        return str(error)
    return ""
