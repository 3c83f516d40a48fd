"""`python -m stages.effects`: joints' effects under the resting policy, reports/studies/effects.json (see `--help`)."""

import argparse
import json
import sys
from functools import partial
from typing import Any

import numpy as np

from mimo.learning import effects
from mimo.record import artifact, identity
from mimo.settings import params, studies
from mimo.vision import extractor
from mimo.world import protocol
from stages.base import console, numbers, paths, store

DIGITS = 4  # significant
MEASURED = "effects"  # name of the one dataset, which is JSON


def main() -> None:
    """Measure the worlds that the store lacks, then write all."""
    from stages.sweep import crew, sweep  # late: Ray, which `digest` does without

    workers = crew.asked(argparse.ArgumentParser(prog="python -m stages.effects")).workers
    p = params.load()
    asked = studies.load(p).effects
    held = artifact.read(paths.ENCODER, store.ENCODER)
    sight = store.sight(held)
    worlds: dict[str, dict[str, Any]] = {"published": {}} | asked.alternatives
    settings = {name: params.changed(p, values) for name, values in worlds.items()}
    digests = {name: digest(own, asked, sight) for name, own in settings.items()}
    todo = {
        name: partial(measure, own, asked, extractor.load(held), digests[name])
        for name, own in settings.items()
        if not store.has(store.EFFECT, digests[name])
    }
    each = len(effects.REGIMES) * asked.steps * asked.worlds
    with console.Progress("Effects", len(todo) * each, "agent steps") as progress:
        for _ in sweep.fill(store.EFFECT, digests, todo, workers):
            progress.update(progress.done + each)
    found = {name: {"set": values} | read(digests[name]) for name, values in worlds.items()}
    steps = (asked.steps - asked.dropped) * asked.worlds
    numbers.write({"steps": steps, "worlds": found}, paths.EFFECTS, DIGITS)


def digest(p: params.Params, asked: studies.Effects, encoder_hash: str) -> identity.Digest:
    """The digest of all that a world's effects depend on, under which the store keeps them."""
    inputs = {
        "params": {name: getattr(p, name).model_dump() for name in ("world", "conditions")}
        | {name: getattr(p.protocol, name) for name in protocol.STEP}
        | {name: getattr(p.encoder, name) for name in extractor.READ}
        | {name: getattr(p.agent, name) for name in ("move_bias", "temperature")}
        | {name: getattr(asked, name) for name in ("steps", "dropped", "worlds")}
        | {"seed": p.seed, "quantiles": p.outcomes.quantiles},
        "encoder": encoder_hash,
        "code": identity.code("mimo.learning.effects"),
        "versions": identity.versions(),
    }
    return identity.Digest(inputs)


def measure(p: params.Params, asked: studies.Effects, trained: extractor.Trained, made_from: str) -> bytes:
    """One world's effects as an artifact.

    Raises:
        FloatingPointError: something does not vary, so that it has no effect.
    """
    text = np.array(json.dumps(effects.measure(p, asked, trained)).encode())
    return artifact.to_bytes(store.EFFECT, made_from, {MEASURED: artifact.Dataset(text, "JSON", "")})


def read(made_from: str) -> dict[str, object]:
    """One world's effects from the store."""
    text = artifact.read(store.place(store.EFFECT, made_from), store.EFFECT, made_from)[MEASURED]
    found: dict[str, object] = json.loads(text.item())
    return found


if __name__ == "__main__":
    sys.exit(console.main(main))
