"""The files that `eomgen simulate` and `eomgen sweep` write into a folder."""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eomgen.api.runs import Run
from eomgen.base.errors import EomgenError
from eomgen.base.files import (
    check_folder,
    check_writable,
    marked,
    remove_ours,
    write_pieces,
    write_whole,
)
from eomgen.run.trajectory import is_own_table, save_csv, save_npz

if TYPE_CHECKING:
    from eomgen.results.ensemble import Ensemble

KINDS = ("py", "npz", "csv", "png", "html")
PICTURES = ("png", "html")
TABLE_PART = 4096
"""Number of lines of a table that are in memory at once."""


def output_paths(
    folder: Path,
    name: str,
    *,
    figure: Path | None = None,
    parquet: bool = False,
    force: bool = False,
) -> dict[str, Path]:
    """The paths of the files of a run, by kind; `figure` replaces the path of the figure, with
    `parquet` there is a Parquet file.

    Makes the folders. Raises `RunError` for a path that cannot be written, before the run begins.
    """
    kinds = (*KINDS, *(("parquet",) if parquet else ()))
    paths = {kind: folder / f"{name}.{kind}" for kind in kinds}
    if figure is not None:
        paths["png"] = figure
        from eomgen.show.style import check_figure  # it loads Matplotlib

        check_figure(figure, force=force)
    for kind, path in paths.items():
        check_folder(path.parent)
        own = path.is_file() and _is_own(kind, path)
        check_writable(path, force=force or own)
    return paths


def _is_own(kind: str, path: Path) -> bool:
    """Whether a table is ours, which has no mark of its own at its start."""
    if kind == "parquet":
        from eomgen.run.parquet import is_own_parquet

        return is_own_parquet(path)
    return kind == "csv" and is_own_table(path)


def save_run(
    run: Run,
    paths: dict[str, Path],
    *,
    pictures: bool = True,
    live: bool | None = None,
    force: bool = False,
) -> str:
    """Write all files. If figure and page cannot be drawn, or without `pictures`, remove those of
    an earlier run and their paths from `paths`. Return why they cannot be drawn, or "". The page is
    live as `Run.page` says.
    """
    run.module.save(paths["py"], force=force)
    # The table first: the archive of the earlier run shows whether its table is ours to overwrite.
    save_csv(run.trajectory, paths["csv"], force=force)
    save_npz(run.trajectory, paths["npz"], force=force)
    if "parquet" in paths:
        from eomgen.run.parquet import save_parquet

        save_parquet(run.trajectory, paths["parquet"], force=force)
    if pictures:
        return _save_pictures(run, paths, live, force)
    _remove_pictures(paths)
    return ""


def _save_pictures(run: Run, paths: dict[str, Path], live: bool | None, force: bool) -> str:
    """Write figure and page; return why they cannot be drawn, or ""."""
    from eomgen.show.figure import save_figure
    from eomgen.show.page import save_page

    try:
        save_figure(run.motion, paths["png"], force=force)
        save_page(run.motion, run.page(live=live), paths["html"], force=force)
    except (EomgenError, KeyboardInterrupt) as error:
        _remove_pictures(paths)
        if isinstance(error, KeyboardInterrupt):
            raise
        return str(error)
    return ""


def _remove_pictures(paths: dict[str, Path]) -> None:
    """Figure and page of an earlier run do not belong to the new numbers."""
    for kind in PICTURES:
        remove_ours(paths.pop(kind))


def save_sweep(
    found: "Ensemble", of: str, table: Path, figure: Path, *, force: bool = False
) -> None:
    """Write the table and the figure of a sweep. Raises `RunError` if a file cannot be written.

    The table has a line for each member: its number, how and when it ended, its varied values, its
    last state, and the outputs there that are one number.
    """
    from eomgen.show.sweep import save_sweep_figure

    write_pieces(table, _member_lines(found), force=force)
    save_sweep_figure(found, of, figure, force=force)


def _member_lines(found: "Ensemble") -> Iterator[str]:
    """The table of a sweep, in pieces."""
    from eomgen.results.ensemble import WORDS

    single = [name for name in found.outputs if found.of(name).ndim == 1]
    names = [*found.design.names, *(f"{name} (end)" for name in (*found.states, *single))]
    yield marked(_csv([["member", "status", "t", *names, "message"]]))
    ends = [found.design.values, found.final, *(found.of(name)[:, None] for name in single)]
    for start in range(0, len(found), TABLE_PART):
        part = slice(start, start + TABLE_PART)
        numbers = np.concatenate([columns[part] for columns in ends], axis=1).tolist()
        status, times, messages = (
            column[part].tolist() for column in (found.codes, found.t, found.messages)
        )
        yield _csv(
            [start + i, WORDS[code], repr(t), *map(repr, values), message]
            for i, (code, t, values, message) in enumerate(
                zip(status, times, numbers, messages, strict=True)
            )
        )


def save_statistics(found: "Ensemble", path: Path, *, force: bool = False) -> None:
    """Write a table with a line for each state or output with one number, and each time that is
    kept: number of members, mean, standard deviation and quantiles of them.

    Raises `RunError` if the file cannot be written.
    """
    from eomgen.results.ensemble import SHARES

    single = [name for name in found.outputs if found.of(name).ndim == 1]
    lines: list[Sequence[object]] = [
        ["name", "unit", "t", "members", "mean", "deviation", *(f"{s:.0%}" for s in SHARES)]
    ]
    for name in (*found.states, *single):
        each = found.statistics(name)
        numbers = np.array([each.mean, each.deviation, *each.quantiles]).T.tolist()
        for t, count, values in zip(
            each.times.tolist(), each.members.tolist(), numbers, strict=True
        ):
            lines.append([name, found.units.get(name, ""), repr(t), count, *map(repr, values)])
    write_whole(path, marked(_csv(lines)), force=force)


def _csv(rows: Iterable[Sequence[object]]) -> str:
    stream = io.StringIO(newline="")
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()
