"""The visual encoder: its loss against loops and hand-worked numbers, its shapes, its bottleneck, its bytes."""

import hashlib
import math
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor, nn

from mimo.record import artifact
from mimo.settings import params
from mimo.vision import encoder
from mimo.vision.encoder import Extractor, Trained, UNet, cltt_loss, images, train

P = params.load()
SETTINGS = P.encoder
PAIRS = st.integers(2, 6)
TAU = st.floats(0.05, 5.0)
SCRIPT = """
import sys
import numpy as np
import torch
from mimo.vision import encoder; from mimo.settings import params
from tests.unit.test_encoder import fingerprint
torch.manual_seed(99)  # torch's own stream must not matter
settings = params.Encoder.model_validate_json(sys.argv[1])
trained = encoder.train(settings, np.load(sys.argv[2]), np.random.default_rng(3))
print(fingerprint(trained))
"""


@pytest.fixture(autouse=True)
def _as_it_was() -> Iterator[None]:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    torch.manual_seed(0)
    yield
    torch.set_num_threads(threads)


def normal(*shape: int, seed: int = 0) -> Tensor:
    return torch.from_numpy(np.random.default_rng(seed).normal(size=shape))


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


# The loss.


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


@given(PAIRS, st.integers(1, 8), TAU, st.integers(0, 99))
def test_the_loss_against_a_loop(pairs: int, width: int, tau: float, seed: int) -> None:
    first, second = normal(2, pairs, width, seed=seed)
    assert cltt_loss(first, second, tau).item() == pytest.approx(nt_xent(first.numpy(), second.numpy(), tau), rel=1e-9)


@pytest.mark.parametrize(
    ("second", "expected"),
    [
        ([[1.0, 0.0], [0.0, 1.0]], math.log(1 + 2 * math.exp(-2))),  # each anchor: itself again 1, two others 0
        ([[0.0, 1.0], [1.0, 0.0]], math.log(2 + math.exp(2))),  # its partner 0, the other pair 0 and 1
        ([[-1.0, 0.0], [0.0, -1.0]], math.log(1 + 2 * math.exp(2))),  # its partner -1, two others 0
        ([[0.0, 5.0], [-3.0, 0.0]], (math.log(2 + math.exp(-2)) + math.log(2 + math.exp(2))) / 2),
    ],
)
def test_the_loss_of_two_pairs_by_hand(second: list[list[float]], expected: float) -> None:
    first = torch.tensor([[1.0, 0.0], [0.0, 1.0]], dtype=torch.float64)
    loss = cltt_loss(first, torch.tensor(second, dtype=torch.float64), 0.5)
    assert loss.item() == pytest.approx(expected, rel=1e-12)


@given(PAIRS, TAU, st.integers(0, 99))
def test_the_loss_ignores_lengths_and_orders(pairs: int, tau: float, seed: int) -> None:
    first, second = normal(2, pairs, 5, seed=seed)
    loss = pytest.approx(cltt_loss(first, second, tau).item(), rel=1e-9)
    rng = np.random.default_rng(seed)
    order = torch.from_numpy(rng.permutation(pairs))
    longer, shorter = torch.from_numpy(rng.uniform(0.01, 100, (2, pairs, 1)))
    assert cltt_loss(first * longer, second * shorter, tau).item() == loss
    assert cltt_loss(first[order], second[order], tau).item() == loss
    assert cltt_loss(second, first, tau).item() == loss


@given(PAIRS, TAU, st.lists(st.floats(0, math.pi / 2), min_size=2, max_size=2, unique=True))
def test_the_loss_falls_as_pairs_align(pairs: int, tau: float, angles: list[float]) -> None:
    """Frames that are orthogonal but for the angle within each pair: only the positives' similarity counts."""
    axes = torch.eye(2 * pairs, dtype=torch.float64)
    near, far = sorted(angles)
    losses = []
    for angle in (near, far):
        second = math.cos(angle) * axes[:pairs] + math.sin(angle) * axes[pairs:]
        losses.append(cltt_loss(axes[:pairs], second, tau).item())
        expected = math.log1p((2 * pairs - 2) * math.exp(-math.cos(angle) / tau))
        assert losses[-1] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert losses[0] <= losses[1] + 1e-12


@given(PAIRS)
def test_the_loss_at_its_limits(pairs: int) -> None:
    """Nothing told apart: one in all the others. Pairs perfectly told apart, cold: nothing left to lose."""
    first, second = normal(2, pairs, 5)
    chance = pytest.approx(math.log(2 * pairs - 1), rel=1e-5)
    assert cltt_loss(torch.ones(pairs, 3), torch.ones(pairs, 3), 0.5).item() == chance
    assert cltt_loss(first, second, 1e7).item() == chance
    axes = torch.eye(pairs, dtype=torch.float64)
    assert cltt_loss(axes, axes, 0.01).item() == pytest.approx(0.0, abs=1e-12)


def test_the_gradient_of_the_loss() -> None:
    first, second = normal(2, 3, 4).requires_grad_()
    assert torch.autograd.gradcheck(lambda a, b: cltt_loss(a, b, 0.5), (first, second))


# The network.


def test_images_are_frames_between_0_and_1() -> None:
    frames = np.zeros((2, 3, 128, 128, 3), np.uint8)
    frames[1, 0, 5, 7] = (255, 51, 0)
    seen = images(frames)
    assert seen.shape == (6, 3, 128, 128)
    assert seen.dtype == torch.float32
    assert seen[3, :, 5, 7].tolist() == pytest.approx([1.0, 0.2, 0.0])
    assert seen.sum().item() == pytest.approx(1.2)


@pytest.mark.parametrize("widths", [SETTINGS.widths, [2, 3, 4, 5]])
def test_four_layers_down_and_four_up(widths: list[int]) -> None:
    net = UNet(SETTINGS.model_copy(update={"widths": widths}))
    shapes: dict[nn.Module, tuple[int, ...]] = {}
    for layer in (*net.down, *net.up):
        layer.register_forward_hook(lambda module, _, out: shapes.update({module: tuple(out.shape)}))
    latent, skips = net.encode(torch.rand(2, 3, 128, 128))
    decoded = net.decode(latent, skips)
    w1, w2, w3, w4 = widths
    down = [(2, w1, 128, 128), (2, w2, 64, 64), (2, w3, 32, 32), (2, w4, 16, 16)]
    assert [shapes[layer] for layer in net.down] == down
    assert [tuple(skip.shape) for skip in skips] == down
    assert [shapes[layer] for layer in net.up] == [(2, w4, 8, 8), (2, w3, 16, 16), (2, w2, 32, 32), (2, w1, 64, 64)]
    assert net.squeeze.in_features == net.expand.out_features == w4 * 8 * 8
    assert latent.shape == (2, 64)
    assert net.project(latent).shape == (2, 512)
    assert decoded.shape == (2, 3, 128, 128)
    assert 0 <= decoded.min() <= decoded.max() <= 1


def test_a_layer_is_convolution_instance_norm_gelu() -> None:
    net = UNet(SETTINGS)
    for layer in (*net.down, *net.up):
        assert isinstance(layer, nn.Sequential)
        assert [type(part) for part in layer] == [nn.Conv2d, nn.InstanceNorm2d, nn.GELU]
        assert not layer[1].track_running_stats  # else a frame would depend on the frames of training


def features(net: UNet, frames: Tensor) -> Tensor:
    """(N, flat), what enters the squeeze."""
    caught: list[Tensor] = []
    handle = net.squeeze.register_forward_pre_hook(lambda _, given: caught.append(given[0]))
    net.encode(frames)
    handle.remove()
    return caught[0]


@pytest.fixture
def net() -> UNet:
    return UNet(SETTINGS.model_copy(update={"widths": [2, 2, 3, 3]})).double()


def silent(skips: Sequence[Tensor]) -> list[Tensor]:
    return [torch.zeros_like(skip) for skip in skips]


def test_the_features_are_the_last_layer_pooled(net: UNet) -> None:
    frames = torch.rand(1, 3, 128, 128, dtype=torch.float64)
    last = net.encode(frames)[1][-1]
    pooled = last.reshape(1, 3, 8, 2, 8, 2).mean((3, 5)).flatten(1)
    torch.testing.assert_close(features(net, frames), pooled)
    torch.testing.assert_close(net.encode(frames)[0], net.squeeze(pooled))


def test_the_decoder_sees_h_alone_of_the_bottleneck(net: UNet) -> None:
    """What squeeze cannot see changes nothing, what it sees changes the picture."""
    frames = torch.rand(1, 3, 128, 128, dtype=torch.float64)
    skips = silent(net.encode(frames)[1])
    seen = features(net, frames).detach().requires_grad_()
    picture = net.decode(net.squeeze(seen), skips)
    rows = torch.linalg.qr(net.squeeze.weight.detach().T)[0]  # (flat, latent), orthonormal
    step = normal(1, seen.shape[1])
    along = step @ rows @ rows.T
    across = step - along
    assert min(along.norm(), across.norm()) > 1
    torch.testing.assert_close(net.decode(net.squeeze(seen + across), skips), picture, rtol=0, atol=1e-12)
    assert (net.decode(net.squeeze(seen + along), skips) - picture).abs().max() > 1e-4
    (gradient,) = torch.autograd.grad((picture * normal(*picture.shape)).sum(), seen)
    assert gradient.norm() > 1e-6
    assert (gradient - gradient @ rows @ rows.T).norm() < 1e-9 * gradient.norm()


def test_h_and_the_skips_both_lead_from_frame_to_picture(net: UNet) -> None:
    frames = torch.rand(1, 3, 128, 128, dtype=torch.float64, requires_grad=True)
    latent, skips = net.encode(frames)
    for h, through in ((latent, silent(skips)), (latent.detach(), skips)):
        (gradient,) = torch.autograd.grad(net.decode(h, through).square().sum(), frames, retain_graph=True)
        assert gradient.abs().max() > 0


def test_each_skip_reaches_the_picture(net: UNet) -> None:
    latent, skips = net.encode(torch.rand(1, 3, 128, 128, dtype=torch.float64))
    picture = net.decode(latent, skips)
    for index in range(4):
        fewer = [torch.zeros_like(skip) if i == index else skip for i, skip in enumerate(skips)]
        assert (net.decode(latent, fewer) - picture).abs().max() > 1e-6


# Training.


@pytest.fixture(scope="session")
def few(pairs: np.ndarray) -> np.ndarray:
    """Six pairs, of all regimes."""
    return np.ascontiguousarray(pairs[4::7])


@pytest.fixture(scope="session")
def brief(tiny: params.Params) -> params.Encoder:
    """All of `few` in every batch, so that losses can be compared."""
    return tiny.encoder.model_copy(update={"pairs": 6, "iterations": 6, "learning_rate": 0.003})


@pytest.fixture(scope="session")
def learned(brief: params.Encoder, few: np.ndarray) -> Trained:
    return train(brief, few, np.random.default_rng(3))


def test_training_lowers_both_losses(learned: Trained, brief: params.Encoder, few: np.ndarray) -> None:
    assert len(few) == 6
    total = learned.reconstruction + brief.cltt_weight * learned.cltt
    assert total.shape == (6,)
    assert (np.diff(total) < 0).all()
    assert (np.diff(learned.reconstruction) < 0).all()
    assert learned.cltt[-1] < learned.cltt[0]


def test_the_first_losses_are_those_of_the_drawn_network(
    learned: Trained, brief: params.Encoder, few: np.ndarray
) -> None:
    """The first frame is reconstructed; first and second are contrasted; losses are means."""
    torch.manual_seed(int(np.random.default_rng(3).integers(2**31)))
    net = UNet(brief)
    first, second = images(few[:, 0]), images(few[:, 1])
    with torch.no_grad():
        latent, skips = net.encode(first)
        error = (net.decode(latent, skips) - first).square().mean().item()
        z = [net.project(h).numpy() for h in (latent, net.encode(second)[0])]
    assert learned.reconstruction[0] == pytest.approx(error, rel=1e-5)
    assert learned.cltt[0] == pytest.approx(nt_xent(z[0], z[1], brief.tau), rel=1e-4)


def test_every_weight_learns(learned: Trained, brief: params.Encoder) -> None:
    torch.manual_seed(int(np.random.default_rng(3).integers(2**31)))
    start = UNet(brief).state_dict()
    assert set(learned.weights) == set(start)
    assert [name for name, value in learned.weights.items() if (value == start[name].numpy()).all()] == []


def test_training_is_the_same_bytes_in_another_process(
    learned: Trained, brief: params.Encoder, few: np.ndarray, tmp_path: Path
) -> None:
    np.save(tmp_path / "few.npy", few)
    command = [sys.executable, "-c", SCRIPT, brief.model_dump_json(), str(tmp_path / "few.npy")]
    there = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert there == fingerprint(learned)


def test_the_generator_decides(tiny: params.Params, few: np.ndarray) -> None:
    once = tiny.encoder.model_copy(update={"iterations": 1, "pairs": 2})
    one, other = (train(once, few, np.random.default_rng(seed)) for seed in (0, 1))
    assert fingerprint(one) != fingerprint(other)


def test_progress_counts_iterations(tiny: params.Params, few: np.ndarray) -> None:
    told: list[int] = []
    train(tiny.encoder.model_copy(update={"iterations": 2, "pairs": 2}), few, np.random.default_rng(0), told.append)
    assert told == [1, 2]


@pytest.mark.parametrize(("change", "iteration"), [({"tau": 1e-320}, 0), ({"learning_rate": 1e30}, 1)])
def test_a_loss_that_is_not_finite_raises_with_its_iteration(
    change: dict[str, float], iteration: int, tiny: params.Params, few: np.ndarray
) -> None:
    told: list[int] = []
    with pytest.raises(FloatingPointError, match=f"not finite at iteration {iteration}$"):
        train(tiny.encoder.model_copy(update=change), few, np.random.default_rng(0), told.append)
    assert told == list(range(1, iteration + 1))


# The frozen extractor.


def test_h_over_the_training_frames_is_centred_and_scaled(
    learned: Trained, brief: params.Encoder, few: np.ndarray
) -> None:
    h = Extractor(brief, learned)(few.reshape(-1, 128, 128, 3)).numpy().astype(float)
    assert h.shape == (12, 64)
    assert h.mean(axis=0) == pytest.approx(np.zeros(64), abs=1e-4)
    assert h.std(axis=0) == pytest.approx(np.full(64, brief.latent_sd), rel=1e-4)
    expected = np.quantile(h, np.arange(1, 100) / 100, axis=0).T
    assert learned.quantiles == pytest.approx(expected, abs=1e-4)
    assert (np.diff(learned.quantiles, axis=1) >= 0).all()


def test_h_is_the_networks_output_less_the_mean_over_the_sd(few: np.ndarray) -> None:
    made = untrained(SETTINGS)
    extract = Extractor(SETTINGS, made)
    with torch.no_grad():
        raw = extract.net.encode(images(few[:, 0]))[0]
    h = extract(few[:, 0])
    assert h.dtype == torch.float32
    torch.testing.assert_close(h, (raw - 0.25) / 2 * SETTINGS.latent_sd)
    assert h.std() > 0


def test_h_is_the_same_bytes_in_any_company(few: np.ndarray) -> None:
    extract = Extractor(SETTINGS, untrained(SETTINGS))
    frames = few.reshape(-1, 128, 128, 3)
    together = extract(frames).numpy()
    assert len({row.tobytes() for row in together}) > 6
    alone = np.concatenate([extract(frame[None]).numpy() for frame in frames])
    assert together.tobytes() == alone.tobytes()
    order = np.random.default_rng(0).permutation(len(frames))
    assert extract(frames[order]).numpy().tobytes() == together[order].tobytes()


def test_the_extractor_is_frozen(few: np.ndarray) -> None:
    made = untrained(SETTINGS)
    extract = Extractor(SETTINGS, made)
    assert not any(weight.requires_grad for weight in extract.net.parameters())
    assert not extract.net.training
    before = extract(few[:, 0]).numpy().tobytes()
    assert not extract(few[:, 0]).requires_grad
    for weight in made.weights.values():  # the network has its own copy
        weight[...] = 0
    assert extract(few[:, 0]).numpy().tobytes() == before


def test_reconstructions_are_pictures(learned: Trained, brief: params.Encoder, few: np.ndarray) -> None:
    extract = Extractor(brief, learned)
    pictures = extract.reconstruct(few[:, 0])
    assert pictures.shape == few[:, 0].shape
    assert pictures.dtype == np.uint8
    with torch.no_grad():
        decoded = extract.net.decode(*extract.net.encode(images(few[:, 0]))).permute(0, 2, 3, 1).numpy()
    assert np.abs(pictures - 255.0 * decoded).max() < 0.51
    error = np.square((pictures - few[:, 0].astype(float)) / 255).mean()
    assert error < learned.reconstruction[0]


def test_an_artifact_gives_the_same_h(learned: Trained, brief: params.Encoder, few: np.ndarray, tmp_path: Path) -> None:
    content = encoder.save(learned, tmp_path / "encoder.h5", "d" * 64, {"r2_free_x": 0.5})
    held = artifact.read(tmp_path / "encoder.h5", encoder.SCHEMA, "d" * 64)
    assert held.content == content
    assert held["measures/r2_free_x"] == 0.5
    again = encoder.load(held)
    assert fingerprint(again) == fingerprint(learned)
    frames = few.reshape(-1, 128, 128, 3)
    assert Extractor(brief, again)(frames).numpy().tobytes() == Extractor(brief, learned)(frames).numpy().tobytes()
