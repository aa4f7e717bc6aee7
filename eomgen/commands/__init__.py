"""The commands, one function each. A command imports its module when it is called."""

import argparse

Arguments = argparse.Namespace


def list_scenes(given: Arguments) -> int:
    """Name the built-in scenes."""
    from eomgen.commands import listing

    return listing.list_scenes(given)


def show(given: Arguments) -> int:
    """Print the file of a scene."""
    from eomgen.commands import scene_files

    return scene_files.show(given)


def new(given: Arguments) -> int:
    """Write a scene to begin with."""
    from eomgen.commands import scene_files

    return scene_files.new(given)


def copy(given: Arguments) -> int:
    """Copy a scene."""
    from eomgen.commands import scene_files

    return scene_files.copy(given)


def import_(given: Arguments) -> int:
    """Write a robot file as a scene."""
    from eomgen.commands import importing

    return importing.import_(given)


def completion(given: Arguments) -> int:
    """Print the completion of a shell."""
    from eomgen.commands import completing

    return completing.completion(given)


def print_schema(given: Arguments) -> int:
    """Print the JSON Schema of scenes."""
    from eomgen.commands import describing

    return describing.print_schema(given)


def print_reference(given: Arguments) -> int:
    """Print joints and effects with their keys."""
    from eomgen.commands import describing

    return describing.print_reference(given)


def check(given: Arguments) -> int:
    """Validate a scene and say what it is made of."""
    from eomgen.commands import describing

    return describing.check(given)


def derive(given: Arguments) -> int:
    """Print the derivation."""
    from eomgen.commands import deriving

    return deriving.derive(given)


def generate(given: Arguments) -> int:
    """Write the modules of scenes."""
    from eomgen.commands import generating

    return generating.generate(given)


def simulate(given: Arguments) -> int:
    """Integrate, and write what happened."""
    from eomgen.commands import running

    return running.simulate(given)


def view(given: Arguments) -> int:
    """Integrate, and open the page."""
    from eomgen.commands import running

    return running.view(given)


def gallery(given: Arguments) -> int:
    """Write the pages of many scenes."""
    from eomgen.commands import exhibiting

    return exhibiting.gallery(given)


def plot(given: Arguments) -> int:
    """Draw a figure of a run."""
    from eomgen.commands import picturing

    return picturing.plot(given)


def film(given: Arguments) -> int:
    """Make a film of a run."""
    from eomgen.commands import picturing

    return picturing.film(given)


def sweep(given: Arguments) -> int:
    """Run a scene many times."""
    from eomgen.commands import sweeping

    return sweeping.sweep(given)


def verify(given: Arguments) -> int:
    """Compare the module with an independent solver and 60 digits."""
    from eomgen.commands import verifying

    return verifying.verify(given)


def accuracy(given: Arguments) -> int:
    """Say what accuracy costs in time."""
    from eomgen.commands import measuring

    return measuring.accuracy(given)


def effects(given: Arguments) -> int:
    """Say what each effect costs and does."""
    from eomgen.commands import costing

    return costing.effects(given)


def linearise(given: Arguments) -> int:
    """Linearise about an equilibrium."""
    from eomgen.commands import linearising

    return linearising.linearise(given)
