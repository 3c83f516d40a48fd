"""`make bench`: CPU time of an agent step of one world, by part, against the physics alone.

One process, CPU time of all its threads; the physics alone is the same rollouts, with the same inputs, nothing else.
Physics and whole alternate in blocks, so that the ratio holds on a busy machine too.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from mimo.learning.experiment import Experiment
from mimo.learning.rewards import REWARDS
from mimo.record import streams
from mimo.settings import params
from mimo.vision import encoder, extractor
from mimo.vision.collect import REGIMES
from mimo.world import scene
from mimo.world.physics import Tied, Worlds

BLOCK = 10  # agent steps
PARTS = ("physics", "eye", "encoder", "learning", "record")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blocks", type=int, default=12, help=f"of {BLOCK} agent steps, after one to warm up")
    parser.add_argument("--seeds", type=int, help="worlds in lock step; default: sweep.chunk")
    parser.add_argument("--rewards", nargs="+", default=["mtl", "cais_surprise"])
    options = parser.parse_args()
    p = params.load()
    size = options.seeds or p.sweep.chunk
    table = Table(title=f"CPU ms of an agent step of one world, {size} in lock step")
    for heading in ("condition, reward", *PARTS, "rest", "whole", "physics alone", "ratio"):
        table.add_column(heading, justify="left" if "," in heading else "right")
    for condition in streams.CONDITIONS:
        for reward in options.rewards:
            times, alone = measure(p, condition, reward, size, options.blocks)
            row = [times[part] for part in PARTS]
            row += [times["whole"] - sum(row), times["whole"], alone]
            table.add_row(f"{condition}, {reward}", *(f"{ms:.2f}" for ms in row), f"{times['whole'] / alone:.2f}")
    Console(width=120).print(table)


def measure(p: params.Params, condition: str, reward: str, size: int, blocks: int) -> tuple[dict[str, float], float]:
    """CPU ms a step and world: by part and whole, and of the physics alone.

    The encoder is untrained and the scales are 1: neither changes how long a step takes.
    """
    trained = untrained(p.encoder)
    run = Experiment(p, condition, reward, range(size), trained, dict.fromkeys(REWARDS, 1.0))
    spent = dict.fromkeys((*PARTS, "whole"), 0.0)
    inputs: list[tuple[np.ndarray, Tied]] = []
    worlds, perception = run.experience.worlds, run.experience.perception
    assert isinstance(worlds, Worlds)
    advance = worlds._advance

    def keep(control: np.ndarray, attached: Tied) -> Any:
        inputs.append((control, attached))
        return advance(control, attached)

    worlds._advance = keep  # type: ignore[method-assign]
    for name in ("_control", "_advance"):
        time_calls(spent, "physics", worlds, name)
    time_calls(spent, "eye", run.eye, "frames")
    for name in ("values", "move_probability", "update"):
        time_calls(spent, "learning", run.agents, name)
    if perception.outcomes:
        for name in ("influence", "expectation", "update"):
            time_calls(spent, "learning", perception.outcomes, name)
    time_calls(spent, "record", run.log, "add")
    perception._extract = timed(spent, "encoder", perception._extract)  # type: ignore[assignment]
    built = scene.build(p.world, p.protocol)
    replay = Worlds(built, p.protocol, getattr(p.conditions, condition).force, [np.random.default_rng(0)] * size)
    alone, first = 0.0, p.protocol.baseline_steps  # attached from the first step measured on
    with run.eye:
        for block in range(blocks + 1):
            if block == 1:
                spent, alone = clear(spent), 0.0
            inputs.clear()
            start = time.process_time()
            for step in range(BLOCK):
                run.step(first + block * BLOCK + step)
            spent["whole"] += time.process_time() - start
            start = time.process_time()
            for control, attached in inputs:
                replay._advance(control, attached)
            alone += time.process_time() - start
    per = 1000.0 / (blocks * BLOCK * size)
    return {part: seconds * per for part, seconds in spent.items()}, alone * per


def untrained(settings: params.Encoder) -> extractor.Trained:
    """A U-Net as initialised, whose h is left as it is."""
    weights = {name: value.numpy() for name, value in encoder.UNet(settings).state_dict().items()}
    zeros, ones = np.zeros(settings.latent, np.float32), np.ones(settings.latent, np.float32)
    quantiles = np.zeros((len(REGIMES), settings.latent, len(extractor.LEVELS)), np.float32)
    return extractor.Trained(weights, zeros, ones, quantiles, zeros, zeros)


def clear(spent: dict[str, float]) -> dict[str, float]:
    """Set every time to 0, in place: the timers hold this dictionary."""
    spent.update(dict.fromkeys(spent, 0.0))
    return spent


def timed(spent: dict[str, float], part: str, call: Callable[..., Any]) -> Callable[..., Any]:
    """`call`, with its CPU time added to `spent[part]`."""

    def run(*arguments: Any) -> Any:
        start = time.process_time()
        result = call(*arguments)
        spent[part] += time.process_time() - start
        return result

    return run


def time_calls(spent: dict[str, float], part: str, owner: Any, name: str) -> None:
    """Replace a method by its timed self."""
    setattr(owner, name, timed(spent, part, getattr(owner, name)))


if __name__ == "__main__":
    main()
