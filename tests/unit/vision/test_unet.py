"""The U-Net: its shapes, its bottleneck, its skip connections."""

from collections.abc import Sequence

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from mimo.settings import params
from mimo.vision.encoder import UNet, images
from tests.unit.vision.reference import normal

SETTINGS = params.load().encoder


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
