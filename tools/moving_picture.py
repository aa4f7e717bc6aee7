"""Draws the README's picture that moves: `python tools/moving_picture.py`.

The two bodies of the handout, thrown upwards, with the paths of their centres of mass and of the
common one.
"""

from pathlib import Path

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

import eomgen
from eomgen.show.plane import draw_pose
from eomgen.show.style import style

PICTURE = Path(__file__).parent.parent / "docs" / "two_body.gif"
FRAMES, A_SECOND, MARGIN = 75, 25, 0.7
MASSES = np.array([1.0, 0.6])


def main() -> None:
    """Write the picture."""
    motion = eomgen.simulate("two_body", samples=FRAMES).motion
    places = motion.places
    common = np.einsum("nbi,b->ni", places, MASSES / MASSES.sum())
    low, high = places.min(axis=(0, 1)) - MARGIN, places.max(axis=(0, 1)) + MARGIN
    width, height = high - low
    with style():
        figure = Figure(figsize=(4.6 * width / height, 4.6))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))

        def draw(frame: int) -> None:
            axes.clear()
            axes.set_axis_off()
            for body, colour in enumerate(motion.colours):
                axes.plot(*places[: frame + 1, body].T, color=colour, linewidth=1.0, alpha=0.6)
            axes.plot(*common[: frame + 1].T, color="#222222", linewidth=1.2, linestyle=":")
            draw_pose(axes, motion, motion.poses[frame], 1.0, zorder=3)
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")

        frames = [*range(len(motion.t)), *[len(motion.t) - 1] * 15]
        animation = FuncAnimation(figure, draw, frames=frames)
        animation.save(PICTURE, PillowWriter(fps=A_SECOND), dpi=90)


if __name__ == "__main__":
    main()
