"""The options of films."""

from dataclasses import dataclass

from eomgen.base.options import option


@dataclass(frozen=True, kw_only=True)
class FilmOptions:
    """The options of `Run.film`, which describes them."""

    fps: float = option(25.0, "frames of a second", value="N")
    speed: float = option(1.0, "0.5 shows the motion half as fast")
    start: float | None = option(
        None, "time of the first frame, s", none="the run's first", flag="--from", value="T"
    )
    end: float | None = option(
        None, "time of the last, s", none="the run's last", flag="--to", value="T"
    )
    size: str = option("", "pixels, 640x480 for example (as it needs them)", value="WxH")
    force: bool = option(False, "also overwrite files that eomgen did not write")
