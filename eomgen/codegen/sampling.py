"""Outputs of models with effects that sample: what a sample sets, and the seeds of its noise."""

from collections.abc import Sequence

from eomgen.codegen.recording import Recording
from eomgen.codegen.system import OutputNodes, SamplingLabel, names_of_inputs
from eomgen.model.clocks import clocks_of
from eomgen.model.model import Model
from eomgen.program.tape import Stage
from eomgen.scene.effects.base import Sampling


def sampling_labels(model: Model, states: Sequence[str]) -> tuple[SamplingLabel, ...]:
    """The effects of a model that sample, with the places of what they set among the states."""
    place = {name: i for i, name in enumerate(states)}
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


def _samplings(model: Model) -> list[Sampling]:
    return [s for effect in model.effects if (s := effect.sampling()) is not None]
