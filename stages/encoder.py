"""`python -m stages.encoder`: train the visual encoder and measure it, data/encoder.h5 and reports/encoder.json."""

import json
import sys
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F

from mimo import artifact, collect, encoder, identity, params, streams
from stages import console, paths, store


def main() -> None:
    """Train the encoder, unless the store has it."""
    p = params.load()
    frames = artifact.read(paths.FRAMES, store.FRAME)
    inputs = {
        "params": {"seed": p.seed, "encoder": p.encoder.model_dump(), "held_out": p.collect.held_out},
        "frames": frames.content,
        "code": identity.code("mimo.encoder", "mimo.streams"),
        "versions": identity.versions(),
    }
    digest = identity.digest(inputs)

    def make(path: Path) -> None:
        cut = round(p.collect.steps * (1 - p.collect.held_out))
        pairs = frames["frames"][:, :, :cut]
        with console.Progress("Encoder", p.encoder.iterations, "iterations") as progress:
            trained = encoder.train(
                p.encoder,
                pairs.reshape(-1, *pairs.shape[3:]),
                streams.generator(p.seed, "free", 0, "encoder"),
                progress.update,
            )
        encoder.save(trained, path, digest, measure(p, trained, frames, cut))

    store.publish(encoder.SCHEMA, digest, paths.ENCODER, make)
    held = artifact.read(paths.ENCODER, encoder.SCHEMA, digest)
    start = "measures/"
    measures = {n[len(start) :]: float(f"{held[n]:.6g}") for n in held.datasets if n.startswith(start)}
    paths.ENCODER_METRICS.parent.mkdir(exist_ok=True)
    paths.ENCODER_METRICS.write_text(json.dumps(measures, indent=2) + "\n")


def measure(p: params.Params, trained: encoder.Trained, frames: artifact.Artifact, cut: int) -> dict[str, float]:
    """Held-out losses, and a linear probe's R² for the mobile's position.

    The probe is one least-squares fit of centre of mass on h over the training frames of all regimes; R² is that of
    held-out frames, by condition and axis, both with and without the rope.
    """
    extract = encoder.Extractor(p.encoder, trained)
    images, centres = frames["frames"][:, :, :, 0], frames["centre_of_mass"][:, :, :, 0]
    latent = extract(images.reshape(-1, *images.shape[3:])).numpy().reshape(*images.shape[:3], -1)
    seen = np.concatenate([latent, np.ones((*latent.shape[:3], 1))], axis=3)
    fit = np.linalg.lstsq(seen[:, :, :cut].reshape(-1, seen.shape[3]), centres[:, :, :cut].reshape(-1, 3))[0]
    measures = {}
    for condition in streams.CONDITIONS:
        chosen = [i for i, (name, _) in enumerate(collect.REGIMES) if name == condition]
        true = centres[chosen][:, :, cut:].reshape(-1, 3)
        error = true - seen[chosen][:, :, cut:].reshape(-1, seen.shape[3]) @ fit
        for axis, letter in enumerate("xyz"):
            spread = np.square(true[:, axis] - true[:, axis].mean()).sum()
            measures[f"r2_{condition}_{letter}"] = float(1 - np.square(error[:, axis]).sum() / spread)
    for (condition, rope), h in zip(collect.REGIMES, latent, strict=True):
        measures[f"latent_sd_{condition}_{'attached' if rope else 'detached'}"] = float(h.std(axis=(0, 1)).mean())
    pairs = frames["frames"][:, :, cut:]
    pairs = pairs.reshape(-1, *pairs.shape[3:])
    with torch.inference_mode():
        z = [
            torch.cat([extract.net.project(extract.net.encode(encoder.images(frame))[0]) for frame in pairs[:, side]])
            for side in (0, 1)
        ]
        order = np.random.default_rng(0).permutation(len(pairs))
        size = min(p.encoder.pairs, len(pairs))
        batches = [torch.from_numpy(order[i : i + size]) for i in range(0, len(order) - size + 1, size)]
        cltt = [encoder.cltt_loss(z[0][chosen], z[1][chosen], p.encoder.tau).item() for chosen in batches]
        shown = pairs[:, 0]
        errors = [
            F.mse_loss(extract.net.decode(*extract.net.encode(image := encoder.images(frame))), image).item()
            for frame in shown
        ]
    return measures | {"reconstruction": float(np.mean(errors)), "cltt": float(np.mean(cltt))}


if __name__ == "__main__":
    sys.exit(console.main(main))
