"""A motion as a film: GIF by Pillow, MP4 by the program ffmpeg."""

import io
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from eomgen.base.errors import RunError
from eomgen.base.files import check_writable, write_whole
from eomgen.run.progress import Progress
from eomgen.show.framing import ASPECT
from eomgen.show.motion import Array, Motion
from eomgen.show.plane import draw_plane
from eomgen.show.space import draw_space
from eomgen.show.style import ink_on, style
from eomgen.show.view import eye_axes

Picture = NDArray[np.uint8]
SUFFIXES = (".gif", ".mp4")
DPI = 100
HEIGHT, WIDTH = 480, 960
"""The height of a film without a given size, pixels, and its greatest width."""
NARROWEST, WIDEST = 0.6, 4.0
"""Width of a film relative to its height, if it has no given size."""
MOST_FRAMES = 5000
COLOURS = 254
"""Colours of a GIF beside that of its background."""


def check_film(path: Path, *, force: bool = False) -> None:
    """Raise `RunError` if a film cannot be written to `path`: another suffix, no ffmpeg, or a file
    that this program did not write.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise RunError(f"{path}: a film is written as .gif or .mp4; '{path.suffix}' is neither")
    if path.suffix.lower() == ".mp4":
        _ffmpeg(path)
    check_writable(path, force=force)


def _ffmpeg(path: Path) -> str:
    found = shutil.which("ffmpeg")
    if found is None:
        raise RunError(
            f"{path}: an MP4 needs the program ffmpeg, which is not on PATH; install it, or write "
            f"{path.with_suffix('.gif')}"
        )
    return found


def pixels_of(text: str, argument: str = "size") -> tuple[int, int]:
    """Width and height of a film, pixels. Raises `RunError` unless the text is such as 640x480."""
    found = re.fullmatch(r"([0-9]{2,4})x([0-9]{2,4})", text)
    if not found:
        raise RunError(f"{argument}: '{text}' is no size of a film; give pixels such as 640x480")
    return int(found[1]), int(found[2])


def frame_rate(path: Path, fps: float) -> float:
    """The frames of a second that a film can have: in a GIF a frame lasts whole hundredths."""
    if path.suffix.lower() == ".gif":
        return 100 / max(2, round(100 / fps))
    return fps


def film_times(start: float, end: float, fps: float, speed: float) -> Array:
    """The times of the frames, s, of a film that runs at `speed` times the real one.

    Raises `RunError` for numbers that are no film, or too many frames.
    """
    for name, value in (("fps", fps), ("speed", speed)):
        if not 0 < value < np.inf:
            raise RunError(f"{name}: {value:g} is not a positive number")
    if not start < end:
        raise RunError(f"from, to: the film would end at {end:g} s and begin at {start:g} s")
    count = (end - start) * fps / speed
    if count > MOST_FRAMES:
        raise RunError(
            f"speed: a film of {count:.0f} frames; at most {MOST_FRAMES} are made: choose a "
            "greater speed, or a shorter part of the run"
        )
    return np.asarray(start + np.arange(int(count + 1e-9) + 1) * speed / fps)


def save_film(
    motion: Motion,
    rows: Sequence[int],
    path: Path,
    *,
    fps: float,
    size: tuple[int, int] | None = None,
    progress: Progress = lambda share: None,
    force: bool = False,
) -> tuple[int, int]:
    """Write a film with a frame for each of the samples `rows`; those between show in the paths of
    the bodies. Return its width and height, pixels.

    Raises `RunError` as `check_film` does, or if ffmpeg fails. An interrupt leaves no file.
    """
    check_film(path, force=force)
    view = _View.of(motion)
    width, height = size or view.pixels()
    width, height = width - width % 2, height - height % 2  # as MP4 needs them
    pictures = _counted(view.frames(rows, width, height), len(rows), progress)
    if path.suffix.lower() == ".gif":
        few = [rows[0], rows[len(rows) // 2], rows[-1]]
        paper = [round(255 * part) for part in to_rgb(motion.camera.background)]
        data = _gif(pictures, view.frames(few, width, height), fps, paper)
    else:
        data = _mp4(pictures, (width, height), fps, _ffmpeg(path), path)
    write_whole(path, data, force=force)
    return width, height


def _counted(pictures: Iterable[Picture], count: int, progress: Progress) -> Iterator[Picture]:
    for k, picture in enumerate(pictures):
        progress(k / count)
        yield picture
    progress(1.0)


class _View:
    """A motion and the part of the plane that its film shows, m."""

    def __init__(self, motion: Motion, low: Array, high: Array) -> None:
        self.motion, self.low, self.high = motion, low, high

    @classmethod
    def of(cls, motion: Motion) -> "_View":
        """The view of the motion's camera; around a body that it follows, from that body."""
        view = motion.camera
        half = np.array([view.width or ASPECT * view.height, view.height]) / 2
        middle = _seen(motion, motion.center)
        return cls(motion, middle - half, middle + half)

    def pixels(self) -> tuple[int, int]:
        """The size of a film of this view."""
        width, height = self.high - self.low
        ratio = float(np.clip(width / height, NARROWEST, WIDEST))
        return round(min(HEIGHT * ratio, WIDTH)), round(min(HEIGHT, WIDTH / ratio))

    def frames(self, rows: Sequence[int], width: int, height: int) -> Iterator[Picture]:
        """The pictures (height, width, 3) of samples."""
        motion = self.motion
        draw: Callable[..., None] = draw_plane if motion.dimensions == 2 else draw_space
        paper = motion.camera.background
        with style():
            figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor=paper)
            canvas: Any = FigureCanvasAgg(figure)
        for k in rows:
            with style():
                figure.clear()
                axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
                draw(axes, motion, [(k, 1.0)], k + 1)
                axes.set_axis_off()
                low, high = self._limits(k, width / height)
                axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
                axes.set_adjustable("datalim")
                axes.text(
                    0.02, 0.98, f"t = {motion.t[k]:.2f} s", transform=axes.transAxes, va="top",
                    color=ink_on(paper), size=9,
                )  # fmt: skip
                canvas.draw()
            # Yielded outside the style: what happens between two frames keeps its own.
            yield np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def _limits(self, k: int, ratio: float) -> tuple[Array, Array]:
        """The corners of the view at a sample, widened to the ratio of the picture."""
        low, high = self.low, self.high
        motion = self.motion
        if motion.camera.follow is not None:
            body = motion.bodies.index(motion.camera.follow)
            place = _seen(motion, motion.places[k, body])
            low, high = low + place, high + place
        middle, half = (low + high) / 2, (high - low) / 2
        half = np.maximum(half, half[::-1] * np.array([ratio, 1 / ratio]))
        return middle - half, middle + half


def _seen(motion: Motion, points: Array) -> Array:
    """World points (…, 2) or (…, 3) as the camera sees them, (…, 2)."""
    if motion.dimensions == 2:
        return points
    eye = eye_axes(motion.camera.azimuth_deg, motion.camera.elevation_deg)
    return np.asarray((points @ eye.T)[..., :2])


def _gif(
    pictures: Iterable[Picture], some: Iterable[Picture], fps: float, paper: Sequence[int]
) -> bytes:
    """A GIF that is shown again and again.

    some   pictures from which its colours are taken, the same in all frames: no colour flickers
    paper  the colour of the background, which is exact; the others are averages of similar ones
    """
    few = Image.fromarray(np.concatenate(list(some)))
    palette = few.quantize(COLOURS, dither=Image.Dither.NONE)
    colours = np.zeros((COLOURS + 1, 3), dtype=int)
    own = np.array(palette.getpalette()).reshape(-1, 3)[:COLOURS]
    colours[: len(own)], colours[-1] = own, paper

    def frame(picture: Picture) -> Image.Image:
        indices = np.array(
            Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)
        )
        indices[(picture == paper).all(axis=2)] = COLOURS
        image = Image.fromarray(indices)
        image.putpalette(colours.ravel().tolist())
        return image

    frames = map(frame, pictures)
    buffer = io.BytesIO()
    next(frames).save(
        buffer,
        format="GIF",
        save_all=True,
        append_images=frames,
        duration=round(1000 / fps),
        loop=0,
        comment=b"eomgen",
    )
    return buffer.getvalue()


def _mp4(
    pictures: Iterable[Picture], size: tuple[int, int], fps: float, ffmpeg: str, path: Path
) -> bytes:
    """An MP4 by ffmpeg, in a process of its own that an interrupt ends."""
    with tempfile.TemporaryDirectory() as folder:
        made, said = Path(folder) / "film.mp4", Path(folder) / "said"
        source = f"-f rawvideo -pix_fmt rgb24 -s {size[0]}x{size[1]} -r {fps:g} -i -".split()
        target = ["-an", "-pix_fmt", "yuv420p", "-q:v", "3", "-metadata", "comment=eomgen film"]
        command = [ffmpeg, "-loglevel", "error", *source, *target, "-fflags", "+bitexact"]
        with said.open("wb") as errors:
            process = subprocess.Popen(
                [*command, str(made)],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,  # an interrupt of the terminal is for this program alone
            )
            assert process.stdin is not None
            try:
                for picture in pictures:
                    process.stdin.write(picture.tobytes())
                process.stdin.close()
                code = process.wait()
            except OSError:  # it has ended: a broken pipe or, on Windows, an invalid argument
                code = process.wait() or 1
            finally:
                process.kill()
                with suppress(OSError):
                    process.stdin.close()
                process.wait()
        if code:
            lines = said.read_text("utf-8", "replace").strip().splitlines() or ["no reason given"]
            raise RunError(f"{path}: ffmpeg failed: {lines[-1]}")
        return made.read_bytes()
