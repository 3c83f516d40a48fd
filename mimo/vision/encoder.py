"""The visual encoder (paper §3.2, appendix): U-Net, projector, CLTT loss and training."""

from collections.abc import Callable, Mapping

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from mimo.record import runtime
from mimo.settings import params
from mimo.vision import inference
from mimo.vision.extractor import LEVELS, Trained

BOTTLENECK = 8  # pixels a side after four halvings of 128
THREADS = 2  # fixed, not the machine's: sums over frames depend on it


class UNet(nn.Module):
    """Four layers down, four up, each convolution, InstanceNorm, GELU and a sampling operator; skip connections.

    The bottleneck (width x 8 x 8) passes through `latent` numbers, h: the decoder sees no more of it than the agent.
    """

    def __init__(self, settings: params.Encoder) -> None:
        super().__init__()
        w1, w2, w3, w4 = settings.widths
        self.flat = w4 * BOTTLENECK**2
        self.down = nn.ModuleList(_layer(i, o) for i, o in ((3, w1), (w1, w2), (w2, w3), (w3, w4)))
        self.up = nn.ModuleList(_layer(i, o) for i, o in ((w4, w4), (2 * w4, w3), (2 * w3, w2), (2 * w2, w1)))
        self.squeeze = nn.Linear(self.flat, settings.latent)
        self.expand = nn.Linear(settings.latent, self.flat)
        self.head = nn.Conv2d(2 * w1, 3, 3, padding=1)
        self.projector = nn.Sequential(
            nn.Linear(settings.latent, settings.projection),
            nn.GELU(),
            nn.Linear(settings.projection, settings.projection),
        )

    def encode(self, images: Tensor) -> tuple[Tensor, list[Tensor]]:
        """Images (N, 3, 128, 128) in [0, 1] to h (N, latent) and the four skip connections, finest first."""
        skips = []
        for layer in self.down:
            images = layer(images)
            skips.append(images)
            images = F.avg_pool2d(images, 2)
        return self.squeeze(images.flatten(1)), skips

    def decode(self, latent: Tensor, skips: list[Tensor]) -> Tensor:
        """H (N, latent) and skips to images (N, 3, 128, 128) in [0, 1]."""
        x = self.expand(latent).view(len(latent), -1, BOTTLENECK, BOTTLENECK)
        for layer, skip in zip(self.up, reversed(skips), strict=True):
            x = torch.cat([F.interpolate(layer(x), scale_factor=2.0), skip], dim=1)
        return torch.sigmoid(self.head(x))

    def project(self, latent: Tensor) -> Tensor:
        """H (N, latent) to the space of the CLTT loss (N, projection)."""
        projected: Tensor = self.projector(latent)
        return projected


def _layer(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(inputs, outputs, 3, padding=1), nn.InstanceNorm2d(outputs, affine=True), nn.GELU())


def cltt_loss(first: Tensor, second: Tensor, tau: float) -> Tensor:
    """Contrastive learning through time: NT-Xent over adjacent frames, mean over both frames of all pairs.

    The paper's equation (eq. cltt) divides the whole denominator by tau and leaves the positive out of it; this is the
    standard form it refers to: every similarity over tau, the sum over all frames but the anchor itself.

    Args:
        first: (pairs, d) projections of the first frame of each pair.
        second: (pairs, d) of the second.
        tau: softmax temperature.
    """
    z = F.normalize(torch.cat([first, second]), dim=1)
    similarity = (z @ z.T / tau).fill_diagonal_(-torch.inf)
    pairs = len(first)
    positive = torch.cat([torch.arange(pairs, 2 * pairs), torch.arange(pairs)])
    return F.cross_entropy(similarity, positive)


def images(frames: np.ndarray) -> Tensor:
    """Frames (..., 128, 128, 3) uint8 to images (N, 3, 128, 128) float32 in [0, 1]."""
    flat = frames.reshape(-1, *frames.shape[-3:])
    return torch.from_numpy(flat).permute(0, 3, 1, 2).float().div_(255.0)


def train(
    settings: params.Encoder,
    pairs: np.ndarray,
    generator: np.random.Generator,
    progress: Callable[[int], None] = lambda iteration: None,
) -> Trained:
    """Train U-Net and projector on frame pairs (paper §3.2): reconstruction plus weighted CLTT loss, AdamW.

    The first frame of each pair is reconstructed; both are contrasted.

    Args:
        settings: `encoder` of params.yaml.
        pairs: (groups, pairs, 2, 128, 128, 3) uint8 frames; they are trained on together, and h is measured in each.
        generator: draws initial weights and batches.
        progress: called with the number of iterations done.

    Raises:
        FloatingPointError: a loss is not finite; names the iteration.
        KernelError: see runtime.check.
    """
    runtime.check("numpy", "torch")
    groups, pairs = len(pairs), pairs.reshape(-1, *pairs.shape[2:])
    torch.set_num_threads(THREADS)
    torch.manual_seed(int(generator.integers(2**31)))
    net = UNet(settings).to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # as frames come: x .75
    optimiser = torch.optim.AdamW(net.parameters(), lr=settings.learning_rate, fused=True)
    curves = np.empty((settings.iterations, 2), np.float32)
    for iteration in range(settings.iterations):
        chosen = generator.choice(len(pairs), size=min(settings.pairs, len(pairs)), replace=False)
        first, second = (images(pairs[chosen, frame]) for frame in (0, 1))
        latent, skips = net.encode(first)
        reconstruction = F.mse_loss(net.decode(latent, skips), first)
        cltt = cltt_loss(net.project(latent), net.project(net.encode(second)[0]), settings.tau)
        curves[iteration] = reconstruction.item(), cltt.item()
        if not np.isfinite(curves[iteration]).all():
            raise FloatingPointError(f"encoder training: the loss is not finite at iteration {iteration}")
        optimiser.zero_grad()
        torch.autograd.backward(reconstruction + settings.cltt_weight * cltt)
        optimiser.step()
        progress(iteration + 1)
    weights = {name: tensor.detach().numpy().copy(order="C") for name, tensor in net.state_dict().items()}
    raw = inference.raw(inference.layers(weights), pairs.reshape(-1, *pairs.shape[2:]))
    mean, sd = raw.mean(axis=0), raw.std(axis=0)
    scaled = ((raw - mean) / sd * settings.latent_sd).reshape(groups, -1, settings.latent)
    quantiles = np.moveaxis(np.quantile(scaled, LEVELS, axis=1), 0, -1).astype(np.float32, order="C")
    return Trained(weights, mean, sd, quantiles, curves[:, 0].copy(), curves[:, 1].copy())


def frozen(settings: params.Encoder, weights: Mapping[str, np.ndarray]) -> UNet:
    """The U-Net with these weights, no longer to be trained."""
    net = UNet(settings)
    net.load_state_dict({name: torch.from_numpy(np.array(value)) for name, value in weights.items()})
    net.eval().requires_grad_(False)
    return net


def reconstruct(net: UNet, frames: np.ndarray, skips: bool = True) -> np.ndarray:
    """(N, 128, 128, 3) uint8 frames to their reconstructions, likewise; without skip connections, of h alone."""
    torch.set_num_threads(1)  # the same sums on every machine
    with torch.inference_mode():
        decoded = []
        for frame in frames:
            latent, passed = net.encode(images(frame))
            decoded.append(net.decode(latent, passed if skips else [torch.zeros_like(s) for s in passed]))
    return torch.cat(decoded).mul(255).round().clamp(0, 255).byte().permute(0, 2, 3, 1).numpy()
