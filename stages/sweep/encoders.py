"""What an agent sees by: the frames that an encoder is trained on, and the encoder, of any params."""

from collections.abc import Callable

from mimo.record import artifact, identity, streams
from mimo.settings import params
from mimo.vision import collect, extractor
from mimo.world import protocol
from stages.base import store


def frames_digest(p: params.Params) -> identity.Digest:
    """The digest of all that the frames depend on."""
    inputs = {
        "params": {
            "conditions": p.conditions.model_dump(),
            "world": p.world.model_dump(exclude={"rope_holds"}),
            "limbs": collect.limbs(p),
        }
        | {name: getattr(p.protocol, name) for name in protocol.STEP if name != "limb"}
        | {name: getattr(p.collect, name) for name in ("worlds", "steps", "pair_updates", "draw")}
        | {"seed": p.seed, "move_bias": p.agent.move_bias, "temperature": p.agent.temperature},
        "code": identity.code("mimo.vision.collect"),
        "versions": identity.versions(),
    }
    return identity.Digest(inputs)


def frames(p: params.Params, progress: Callable[[int], None] = lambda steps: None) -> bytes:
    """The file of frames collected under the resting policy; `progress` counts agent steps over all worlds."""
    seen, centres = collect.collect(p, progress)
    datasets = {
        "frames": artifact.Dataset(seen, "8-bit intensity", "regime, world, step, frame, row, column, rgb"),
        "centre_of_mass": artifact.Dataset(centres, "m", "regime, world, step, frame, xyz"),
    }
    regimes = "; ".join(f"{name}, {'attached' if rope else 'detached'}" for name, rope in collect.REGIMES)
    about = {"regimes": regimes, "limbs": ", ".join(collect.limbs(p))}
    return artifact.to_bytes(store.FRAME, frames_digest(p), datasets, about)


def digest(p: params.Params, held: artifact.Artifact, measured: bool = True) -> identity.Digest:
    """The digest of all that an encoder depends on; how it was measured, too, if it is.

    Args:
        p: all of params.yaml.
        held: the frames.
        measured: whether the probe's numbers are with it.
    """
    modules = ("mimo.vision.encoder", "mimo.record.streams", *(["mimo.vision.probe"] if measured else []))
    own: dict[str, object] = {"seed": p.seed, "encoder": p.encoder.model_dump(), "held_out": p.collect.held_out}
    own |= {"draw": p.collect.draw}
    return identity.Digest(
        {
            "params": own,
            "frames": held.content,
            "limbs": held.about["limbs"],
            "code": identity.code(*modules),
            "versions": identity.versions(),
        }
    )


def encoder(
    p: params.Params,
    held: artifact.Artifact,
    measured: bool = True,
    progress: Callable[[int], None] = lambda iterations: None,
) -> bytes:
    """The file of an encoder by `p.encoder`, trained on the frames that are not held out.

    Args:
        p: all of params.yaml.
        held: the frames.
        measured: whether the probe measures it, on those that are.
        progress: counts iterations.
    """
    from mimo.vision import encoder as training  # late: torch, which the digests do without

    seen, cut = held["frames"], round(p.collect.steps * (1 - p.collect.held_out))
    pairs = seen[:, :, :cut]
    draws = streams.generator(p.seed, "free", p.collect.draw, "encoder")
    trained = training.train(p.encoder, pairs.reshape(len(pairs), -1, *pairs.shape[3:]), draws, progress)
    found: dict[str, float] = {}
    if measured:
        from mimo.vision import probe

        tied = str(held.about["limbs"]).split(", ")
        found = probe.measure(p, tied, trained, seen, held["centre_of_mass"], cut)
    return extractor.to_bytes(trained, digest(p, held, measured), found)


def measures(held: artifact.Artifact) -> dict[str, float]:
    """What the probe found of an encoder."""
    start = "measures/"
    return {name.removeprefix(start): float(held[name]) for name in held.datasets if name.startswith(start)}
