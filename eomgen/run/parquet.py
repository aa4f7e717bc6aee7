"""Trajectories as Parquet files, by pyarrow, which is an extra."""

import io
from importlib.util import find_spec
from pathlib import Path

from eomgen.base.errors import RunError
from eomgen.base.files import write_whole
from eomgen.run.trajectory import Trajectory, table_of

NEEDED = "needs pyarrow; run: pip install 'eomgen[parquet]'"


def check_parquet(argument: str) -> None:
    """Raise `RunError`, which names the `argument`, if pyarrow is not installed."""
    if find_spec("pyarrow") is None:
        raise RunError(f"{argument}: {NEEDED}")


def save_parquet(trajectory: Trajectory, path: Path, force: bool = False) -> None:
    """Write the table of `trajectory.save_csv` as a Parquet file.

    Raises `RunError` without pyarrow, or as `save_csv` does.
    """
    check_parquet("Parquet")
    import pyarrow
    from pyarrow import parquet

    buffer = io.BytesIO()
    about = {"written by": "eomgen", "scene": trajectory.name}
    table = pyarrow.table(table_of(trajectory))
    parquet.write_table(table.replace_schema_metadata(about), buffer)
    write_whole(path, buffer.getvalue(), force=force or is_own_parquet(path))


def is_own_parquet(path: Path) -> bool:
    """Whether this program wrote a Parquet file, which its metadata say."""
    from pyarrow import ArrowException, parquet

    try:
        metadata = parquet.read_schema(path).metadata or {}
    except (OSError, ArrowException):
        return False
    return bool(metadata.get(b"written by") == b"eomgen")
