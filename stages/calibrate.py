"""`python -m stages.calibrate`: the scale of each reward, data/scales.h5."""

import sys
from pathlib import Path

import numpy as np

from mimo import artifact, calibrate, encoder, identity, params
from stages import console, paths, store


def main() -> None:
    """Measure every reward under the resting policy, unless the store has the scales."""
    p = params.load()
    held = artifact.read(paths.ENCODER, encoder.SCHEMA)
    inputs = {
        "params": {name: getattr(p, name).model_dump() for name in ("world", "outcomes", "calibrate")}
        | {name: getattr(p.protocol, name) for name in ("limb", "updates_per_step", "torque_updates", "timestep")}
        | {name: getattr(p.encoder, name) for name in ("widths", "latent", "projection", "latent_sd")}
        | {name: value for name, value in p.rewards.model_dump().items() if name != "gain"}
        | {
            "seed": p.seed,
            "force": p.conditions.free.force,
            "move_bias": p.agent.move_bias,
            "temperature": p.agent.temperature,
        },
        "encoder": held.content,
        "code": identity.code("mimo.calibrate"),
        "versions": identity.versions(),
    }
    digest = identity.digest(inputs)

    def make(path: Path) -> None:
        total = p.calibrate.steps * p.calibrate.worlds
        with console.Progress("Reward scales", total, "agent steps") as progress:
            found = calibrate.scales(p, encoder.load(held), progress.update)
        datasets = {name: artifact.Dataset(np.array(value), "own units", "") for name, value in found.items()}
        artifact.write(path, store.SCALE, digest, datasets)

    store.publish(store.SCALE, digest, paths.SCALES, make)


if __name__ == "__main__":
    sys.exit(console.main(main))
