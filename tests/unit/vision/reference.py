"""What the encoder's tests compare with: the loss by its definition, an untrained network, all that training gave."""

import hashlib
import math

import numpy as np
import torch
from torch import Tensor

from mimo.settings import params
from mimo.vision.encoder import UNet
from mimo.vision.extractor import Trained


def normal(*shape: int, seed: int = 0) -> Tensor:
    return torch.from_numpy(np.random.default_rng(seed).normal(size=shape))


def nt_xent(first: np.ndarray, second: np.ndarray, tau: float) -> float:
    """Chen et al. 2020, eq. 1, by its definition: a loop over anchors and over all the others."""
    z = [*first, *second]
    pairs, total = len(first), 0.0
    for i, anchor in enumerate(z):
        j = (i + pairs) % (2 * pairs)
        near = [float(np.dot(anchor, w) / np.linalg.norm(anchor) / np.linalg.norm(w)) for w in z]
        below = sum(math.exp(near[k] / tau) for k in range(2 * pairs) if k != i)
        total -= math.log(math.exp(near[j] / tau) / below)
    return total / (2 * pairs)


def fingerprint(trained: Trained) -> str:
    """SHA-256 of all that training gave."""
    total = hashlib.sha256()
    for name, value in sorted(trained.weights.items()):
        total.update(name.encode() + value.tobytes())
    for array in (trained.mean, trained.sd, trained.quantiles, trained.reconstruction, trained.cltt):
        total.update(str(array.dtype).encode() + array.tobytes())
    return total.hexdigest()


def untrained(settings: params.Encoder) -> Trained:
    """The network as it is drawn, with a scaling that is not the identity."""
    weights = {name: value.detach().numpy().copy() for name, value in UNet(settings).state_dict().items()}
    ones, none = np.ones(settings.latent, np.float32), np.zeros(0, np.float32)
    return Trained(weights, 0.25 * ones, 2 * ones, np.zeros((settings.latent, 99), np.float32), none, none)
