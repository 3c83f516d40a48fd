"""`python -m stages.collect`: frames for the encoder, data/frames.h5."""

import sys
from pathlib import Path

from mimo.record import artifact, identity
from mimo.settings import params
from mimo.vision import collect
from mimo.world import protocol
from stages.base import console, paths, store


def main() -> None:
    """Collect frames under the resting policy, unless the store has them."""
    p = params.load()
    digest = made_from(p)

    def make(path: Path) -> None:
        total = len(collect.REGIMES) * p.collect.worlds * p.collect.steps
        with console.Progress("Frames", total, "agent steps") as progress:
            frames, centres = collect.collect(p, progress.update)
        datasets = {
            "frames": artifact.Dataset(frames, "8-bit intensity", "regime, world, step, frame, row, column, rgb"),
            "centre_of_mass": artifact.Dataset(centres, "m", "regime, world, step, frame, xyz"),
        }
        regimes = "; ".join(f"{name}, {'attached' if rope else 'detached'}" for name, rope in collect.REGIMES)
        artifact.write(path, store.FRAME, digest, datasets, {"regimes": regimes})

    store.publish(store.FRAME, digest, paths.FRAMES, make)


def made_from(p: params.Params) -> identity.Digest:
    """The digest of all that the frames depend on."""
    inputs = {
        "params": {name: getattr(p, name).model_dump() for name in ("conditions", "world")}
        | {name: getattr(p.protocol, name) for name in protocol.STEP}
        | {name: getattr(p.collect, name) for name in ("worlds", "steps", "pair_updates")}
        | {"seed": p.seed, "move_bias": p.agent.move_bias, "temperature": p.agent.temperature},
        "code": identity.code("mimo.vision.collect"),
        "versions": identity.versions(),
    }
    return identity.Digest(inputs)


if __name__ == "__main__":
    sys.exit(console.main(main))
