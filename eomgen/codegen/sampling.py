"""Outputs of models with effects that sample: what a sample sets, and the seeds of its noise."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

from eomgen.codegen.recording import Recording
from eomgen.codegen.system import OutputNodes, SamplingLabel, names_of_inputs
from eomgen.model.clocks import clocks_of
from eomgen.model.model import Model
from eomgen.program.tape import Stage
from eomgen.scene.effects.base import Sampling


def sampling_labels(model: Model, states: Sequence[str]) -> tuple[SamplingLabel, ...]:
    """The effects of a model that sample, with the places of what they set among the states."""
    place = {name: i for i, name in enumerate(states)}
    if not model.sampled:
        return ()
    per_second, clocks = clocks_of(model.effects)
    labels = []
    for sampling, clock in zip(_samplings(model), clocks, strict=True):
        due = sampling.due
        ahead = [due[name][-1] if due[name] else name for name in sampling.holds]
        chains = [(name, *due[name]) for name in sampling.holds]
        labels.append(
            SamplingLabel(
                *(clock.effect, per_second, clock.period, clock.lag),
                sets=tuple(place[name] for name in (*sampling.sets, *ahead)),
                moves=tuple(
                    (place[chain[i]], place[chain[i + 1]])
                    for chain in chains
                    for i in range(len(chain) - 1)
                ),
                noises=sampling.noisy,
            )
        )
    return tuple(labels)


def sampling_outputs(record: Recording) -> tuple[OutputNodes, dict[str, tuple[str, ...]]]:
    """The outputs of a model with effects that sample, and the names of the noise that one takes:
    what samples set, one effect after the other; and the seeds.
    """
    d, nodes, given = record.dynamics, [], []
    for effect in record.model.effects:
        if (sampling := effect.sampling()) is None:
            continue
        noise = {name: record.input(f"noise__{name}", Stage.INPUTS) for name in sampling.noisy}
        given += list(noise.values())
        nodes += list(effect.samples(d, noise))
    seeds = [d.value(sampling.seed) for sampling in _samplings(record.model)]
    outputs: OutputNodes = {
        "samples": ((len(nodes),), record.closed(nodes)),
        "seeds": ((len(seeds),), seeds),
    }
    return outputs, {"samples": names_of_inputs(given)}


@dataclass(frozen=True)
class ClockValues:
    """The values of `engine.sampling.Clocks` that a model has from the beginning, in its order."""

    many: int
    sets: int
    noises: int
    pairs: int
    per_second: float
    periods: tuple[float, ...]
    lags: tuple[float, ...]
    first_set: tuple[int, ...]
    first_noise: tuple[int, ...]
    first_pair: tuple[int, ...]
    places: tuple[int, ...]
    targets: tuple[int, ...]
    sources: tuple[int, ...]


def clock_values(labels: Sequence[SamplingLabel]) -> ClockValues:
    """Those of the effects that sample, at least one."""
    sizes = zip(*((len(x.sets), len(x.noises), len(x.moves)) for x in labels), strict=True)
    sets, noises, pairs = (tuple(accumulate(size, initial=0)) for size in sizes)
    moves = [move for each in labels for move in each.moves]
    return ClockValues(
        *(len(labels), sets[-1], noises[-1], pairs[-1], float(labels[0].per_second)),
        periods=tuple(float(each.period) for each in labels),
        lags=tuple(float(each.lag) for each in labels),
        first_set=sets,
        first_noise=noises,
        first_pair=pairs,
        places=tuple(i for each in labels for i in each.sets),
        targets=tuple(a for a, _ in moves),
        sources=tuple(b for _, b in moves),
    )


def _samplings(model: Model) -> list[Sampling]:
    return [s for effect in model.effects if (s := effect.sampling()) is not None]
