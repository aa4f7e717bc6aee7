"""The command `gallery`."""

from dataclasses import replace

from eomgen.api.exhibiting import (
    chosen_scenes,
    exhibited,
    forecast,
    gallery_paths,
    save_index,
)
from eomgen.api.options import RunOptions
from eomgen.base.errors import EomgenError, InterruptedRunError, report_refusal
from eomgen.commands.shared import Arguments, reporter_of
from eomgen.commands.usage import taken
from eomgen.run.progress import rough_time
from eomgen.scene.built_in import built_in_names
from eomgen.show.gallery import Exhibit, megabytes


def gallery(given: Arguments) -> int:
    """Write the pages of scenes and the page that leads to them.

    An error of one scene is reported, the others are still shown, and the exit code is 1.
    """
    names = given.scene or built_in_names()
    scenes = chosen_scenes(names)
    paths = gallery_paths(given.output, scenes, force=given.force)
    left, done, refused = forecast(scenes), list[Exhibit](), False
    try:
        for k, (name, scene) in enumerate(zip(names, scenes, strict=True), 1):
            reporter = replace(reporter_of(given, name), trial=lambda text: None)
            try:
                shown = exhibited(
                    scene,
                    taken(RunOptions, given, source=scene),
                    paths[scene.name],
                    live=given.live,
                    force=given.force,
                    reporter=reporter,
                )
            except EomgenError as error:
                report_refusal(error)
                refused = True
                continue
            done.append(shown)
            rest = f", about {rough_time(left(k))} left" if k < len(scenes) else ""
            print(
                f"{k} of {len(scenes)}: wrote {paths[scene.name]}, {megabytes(shown.size)}{rest}",
                flush=True,
            )
    except KeyboardInterrupt:
        save_index(paths[""], done, force=given.force)
        kept = f"; {paths['']} shows the {len(done)} of {len(scenes)} that are done" if done else ""
        raise InterruptedRunError(f"gallery: interrupted{kept}") from None
    save_index(paths[""], done, force=given.force)
    if done:
        print(f"wrote {paths['']}; open it in a browser")
    return 1 if refused else 0
