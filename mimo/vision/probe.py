"""What the encoder is worth: held-out losses, and how well a linear probe reads the mobile's position off h."""

from collections.abc import Sequence

import numpy as np
import torch
import torch.nn.functional as F

from mimo.record import streams
from mimo.settings.params import Params
from mimo.vision import collect, encoder
from mimo.vision.extractor import Extractor, Trained


def measure(
    p: Params, tied: Sequence[str], trained: Trained, frames: np.ndarray, centres_of_mass: np.ndarray, cut: int
) -> dict[str, float]:
    """Held-out losses, and a linear probe's R² for the mobile's position.

    The probe is one least-squares fit of centre of mass on h over the training frames of all regimes, both of each
    pair; R² is that of held-out frames, by condition and axis, with and without the rope together. Where frames are of
    several limbs, there is also R² with the rope tied to each.

    Args:
        p: all of params.yaml.
        tied: which limbs the rope was tied to, world by world, round and round.
        trained: the encoder.
        frames: (regime, world, step, 2, 128, 128, 3) uint8, as collect.collect returns them.
        centres_of_mass: (regime, world, step, 2, 3) m, likewise.
        cut: the first held-out step.

    Returns:
        r2_<condition>_<axis>, r2_<condition>_<axis>_<limb> of several limbs, latent_sd_<condition>_<rope> (mean over
        dimensions), reconstruction (squared intensity), cltt (nat).
    """
    latent = Extractor(p.encoder, trained)(frames.reshape(-1, *frames.shape[4:])).reshape(*frames.shape[:4], -1)
    seen = np.concatenate([latent, np.ones((*latent.shape[:4], 1))], axis=4)
    columns = seen.shape[4]
    fit = np.linalg.lstsq(seen[:, :, :cut].reshape(-1, columns), centres_of_mass[:, :, :cut].reshape(-1, 3))[0]
    measures = {}
    for condition in streams.CONDITIONS:
        chosen = [i for i, (name, _) in enumerate(collect.REGIMES) if name == condition]
        roped = [collect.REGIMES.index((condition, True))]
        parts = {"": (chosen, slice(None))}
        if len(tied) > 1:
            parts |= {f"_{limb}": (roped, slice(place, None, len(tied))) for place, limb in enumerate(tied)}
        for part, (regimes, worlds) in parts.items():
            true = centres_of_mass[regimes][:, worlds, cut:].reshape(-1, 3)
            error = true - seen[regimes][:, worlds, cut:].reshape(-1, columns) @ fit
            for axis, letter in enumerate("xyz"):
                spread = np.square(true[:, axis] - true[:, axis].mean()).sum()
                measures[f"r2_{condition}_{letter}{part}"] = float(1 - np.square(error[:, axis]).sum() / spread)
    for (condition, rope), h in zip(collect.REGIMES, latent, strict=True):
        measures[f"latent_sd_{condition}_{'attached' if rope else 'detached'}"] = float(h.std(axis=(0, 1, 2)).mean())
    pairs = frames[:, :, cut:]
    pairs = pairs.reshape(-1, *pairs.shape[3:])
    net = encoder.frozen(p.encoder, trained.weights)
    with torch.inference_mode():
        z = [
            torch.cat([net.project(net.encode(encoder.images(frame))[0]) for frame in pairs[:, side]])
            for side in (0, 1)
        ]
        order = np.random.default_rng(0).permutation(len(pairs))
        size = min(p.encoder.pairs, len(pairs))
        batches = [torch.from_numpy(order[i : i + size]) for i in range(0, len(order) - size + 1, size)]
        cltt = [encoder.cltt_loss(z[0][chosen], z[1][chosen], p.encoder.tau).item() for chosen in batches]
        shown = pairs[:, 0]
        errors = [F.mse_loss(net.decode(*net.encode(image := encoder.images(frame))), image).item() for frame in shown]
    return measures | {"reconstruction": float(np.mean(errors)), "cltt": float(np.mean(cltt))}
