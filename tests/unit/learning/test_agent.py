"""The agent against hand-worked numbers, autograd in float64, and one torch module per seed."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from torch import Tensor, nn

from mimo.learning.agent import MOVE, NO_TORQUE, Agents, Linear, Network, policy, sarsa_target, td_error
from mimo.settings import params

INPUTS, HIDDEN, JOINTS = 111, 64, 12
SETTINGS = params.Agent(hidden=HIDDEN, learning_rate=0.001, gamma=0.1, temperature=0.3, move_bias=-0.2)
Q = st.floats(-5, 5, width=32)


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def agents(seeds: Sequence[int]) -> Agents:
    return Agents(SETTINGS, INPUTS, [np.random.default_rng((seed, 0)) for seed in seeds])


def normal(generator: np.random.Generator, *shape: int) -> Tensor:
    return torch.from_numpy(generator.normal(size=shape)).float()


class Residual(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.inner = nn.Sequential(nn.Linear(HIDDEN, HIDDEN), nn.LayerNorm(HIDDEN), nn.GELU())

    def forward(self, x: Tensor) -> Tensor:
        return x + self.inner(x)


def reference(network: Network, seed: int) -> nn.Sequential:
    """The paper's network in torch's own layers, in float64, with the weights of one seed."""
    module = nn.Sequential(
        nn.Linear(INPUTS, HIDDEN), nn.LayerNorm(HIDDEN), Residual(), Residual(), nn.LayerNorm(HIDDEN),
        nn.Linear(HIDDEN, 24), nn.Unflatten(-1, (JOINTS, 2)),
    ).double()  # fmt: skip
    for ours, theirs in zip(parts(network), module.parameters(), strict=True):
        theirs.data.copy_(ours[seed])
    return module


def parts(network: Network) -> list[Tensor]:
    """All parameters, each (N, *shape), in the order of `reference`."""
    inner = [part for residual in network.residuals for layer in residual for part in layer]
    return [*network.inlet, *network.inlet_norm, *inner, *network.outlet_norm, *network.outlet]


def test_policy_by_hand() -> None:
    values = torch.tensor([[0.0, 0.2], [0.3, 0.5 + 0.3 * math.log(3)]], dtype=torch.float64)
    torch.testing.assert_close(policy(values, -0.2, 0.3), torch.tensor([[0.5, 0.5], [0.25, 0.75]], dtype=torch.float64))


@given(st.lists(st.tuples(Q, Q), min_size=1, max_size=20), Q, st.floats(0.05, 5))
def test_policy_laws(pairs: list[tuple[float, float]], bias: float, temperature: float) -> None:
    values = torch.tensor(pairs, dtype=torch.float64)
    probabilities = policy(values, bias, temperature)
    torch.testing.assert_close(probabilities.sum(-1), torch.ones(len(pairs), dtype=torch.float64))
    assert ((probabilities >= 0) & (probabilities <= 1)).all()
    torch.testing.assert_close(policy(values + 3, bias, temperature), probabilities)
    torch.testing.assert_close(policy(values.flip(-1), -bias, temperature).flip(-1), probabilities)
    log_odds = (values[:, MOVE] + bias - values[:, NO_TORQUE]) / temperature
    torch.testing.assert_close(probabilities[:, MOVE], torch.sigmoid(log_odds))


def test_td_error_by_hand() -> None:
    following = torch.tensor([[1.0, 3.0]])
    target = sarsa_target(torch.tensor([0.5]), following, torch.tensor([[0.75, 0.25]]), gamma=0.1)
    torch.testing.assert_close(target, torch.tensor([0.65]))  # 0.5 + 0.1 * 1.5
    values = torch.tensor([[0.25, -1.0]])
    torch.testing.assert_close(td_error(target, values, torch.tensor([False])), torch.tensor([0.4]))
    torch.testing.assert_close(td_error(target, values, torch.tensor([True])), torch.tensor([1.65]))


def test_update_returns_the_td_error_with_the_bias_in_the_policy_alone() -> None:
    three, generator = agents([1, 2, 3]), np.random.default_rng(0)
    state, following = normal(generator, 3, INPUTS), normal(generator, 3, INPUTS)
    reward, action = normal(generator, 3, JOINTS), normal(generator, 3, JOINTS) > 0
    now, then = three.values(state).double().numpy(), three.values(following).double().numpy()
    move = 1 / (1 + np.exp(-(then[..., 1] - 0.2 - then[..., 0]) / 0.3))
    taken = np.where(action.numpy(), now[..., 1], now[..., 0])
    expected = reward.numpy() + 0.1 * (move * then[..., 1] + (1 - move) * then[..., 0]) - taken
    np.testing.assert_allclose(three.move_probability(torch.from_numpy(then)).numpy(), move, rtol=1e-6)
    np.testing.assert_allclose(three.update(state, action, reward, following).numpy(), expected, atol=1e-5)


def test_weights_start_as_in_torch() -> None:
    two = agents([5, 6])
    linears = [two.network.inlet, two.network.residuals[0].linear, two.network.residuals[1].linear, two.network.outlet]
    for linear in linears:
        bound = 1 / math.sqrt(linear.weight.shape[-1])
        for seed in range(2):
            drawn = torch.cat([part[seed].flatten() for part in linear]).double().numpy()
            assert stats.kstest(drawn, stats.uniform(-bound, 2 * bound).cdf).pvalue > 0.001
        assert not torch.equal(linear.weight[0], linear.weight[1])
    for norm in (two.network.inlet_norm, *(residual.norm for residual in two.network.residuals)):
        assert torch.equal(norm.weight, torch.ones(2, HIDDEN))
        assert torch.equal(norm.bias, torch.zeros(2, HIDDEN))


def test_every_parameter_has_its_own_place() -> None:
    network = Network.over(torch.arange(float(Network.size(INPUTS, HIDDEN)))[None], INPUTS, HIDDEN)
    places = torch.cat([part.flatten() for part in parts(network)])
    assert torch.equal(places.sort().values, torch.arange(float(Network.size(INPUTS, HIDDEN))))


def test_backward_against_autograd() -> None:
    size, generator = Network.size(INPUTS, HIDDEN), np.random.default_rng(1)
    network = Network.over(torch.from_numpy(generator.normal(size=(3, size))) / 5, INPUTS, HIDDEN)
    state = torch.from_numpy(generator.normal(size=(3, INPUTS)))
    upstream = torch.from_numpy(generator.normal(size=(3, JOINTS, 2)))
    gradient = Network.over(torch.full((3, size), torch.nan, dtype=torch.float64), INPUTS, HIDDEN)
    values, saved = network.forward(state)
    network.backward(saved, upstream, gradient)
    for seed in range(3):
        module = reference(network, seed)
        output = module(state[seed : seed + 1])
        torch.testing.assert_close(values[seed], output[0].detach())
        (output[0] * upstream[seed]).sum().backward()
        for ours, theirs in zip(parts(gradient), module.parameters(), strict=True):
            torch.testing.assert_close(ours[seed], theirs.grad)


def test_updates_follow_torchs_adamw_on_single_modules() -> None:
    two, generator = agents([8, 9]), np.random.default_rng(2)
    modules = [reference(two.network, seed) for seed in range(2)]
    optimizers = [torch.optim.AdamW(module.parameters(), lr=0.001) for module in modules]
    for _ in range(25):
        state, following = normal(generator, 2, INPUTS), normal(generator, 2, INPUTS)
        reward, action = normal(generator, 2, JOINTS), normal(generator, 2, JOINTS) > 0
        two.update(state, action, reward, following)
        for seed, (module, optimizer) in enumerate(zip(modules, optimizers, strict=True)):
            with torch.no_grad():
                then = module(following[seed].double()[None])[0]
                move = torch.softmax((then + torch.tensor([0, -0.2])) / 0.3, -1)
                target = reward[seed] + 0.1 * (move * then).sum(-1)
            taken = module(state[seed].double()[None])[0].gather(-1, action[seed].long()[:, None])[:, 0]
            optimizer.zero_grad()
            (0.5 * (target - taken) ** 2).sum().backward()
            optimizer.step()
    for seed, module in enumerate(modules):
        for ours, theirs in zip(parts(two.network), module.parameters(), strict=True):
            torch.testing.assert_close(ours[seed].double(), theirs.detach(), atol=5e-5, rtol=0)  # decay alone: 2.5e-4


def test_values_arrive_at_a_constant_reward() -> None:
    one, generator = agents([4]), np.random.default_rng(3)
    for _ in range(600):
        state, following = normal(generator, 1, INPUTS), normal(generator, 1, INPUTS)
        action = torch.from_numpy(generator.random((1, JOINTS)) < 0.5)
        one.update(state, action, torch.full((1, JOINTS), 0.9), following)
    values = torch.cat([one.values(normal(generator, 1, INPUTS)) for _ in range(50)])
    torch.testing.assert_close(values.mean(0), torch.ones(JOINTS, 2), atol=0.15, rtol=0)  # 0.9 / (1 - 0.1)


def test_nothing_hides_a_nan() -> None:
    two, generator = agents([1, 2]), np.random.default_rng(4)
    reward = torch.zeros(2, JOINTS)
    reward[0, 3] = torch.nan
    action = torch.ones(2, JOINTS, dtype=torch.bool)
    error = two.update(normal(generator, 2, INPUTS), action, reward, normal(generator, 2, INPUTS))
    assert error[0, 3].isnan()
    after = two.values(normal(generator, 2, INPUTS))
    assert after[0].isnan().all()
    assert after[1].isfinite().all()


def history(seeds: Sequence[int], steps: int) -> dict[int, bytes]:
    """All that the agents of `seeds` give over `steps` updates, in bytes."""
    stack, worlds = agents(seeds), [np.random.default_rng((seed, 1)) for seed in seeds]

    def draw(size: int) -> Tensor:
        return torch.from_numpy(np.stack([world.normal(size=size) for world in worlds])).float()

    state, seen = draw(INPUTS), dict.fromkeys(seeds, b"")
    for _ in range(steps):
        values = stack.values(state)
        probability = stack.move_probability(values)
        following = draw(INPUTS)
        error = stack.update(state, draw(JOINTS) < probability, draw(JOINTS), following)
        state = following
        for place, seed in enumerate(seeds):
            seen[seed] += b"".join(part[place].numpy().tobytes() for part in (values, probability.contiguous(), error))
    return seen


def test_a_seeds_bytes_do_not_depend_on_its_companions() -> None:
    whole = history(range(10), 250)
    assert len(set(whole.values())) == 10
    for seeds in ([0], [7], [9, 7], [3, 4, 5], [8, 7, 1, 0, 2]):
        for seed, seen in history(seeds, 250).items():
            assert seen == whole[seed], f"seed {seed} among {seeds}"


def test_linear_by_hand() -> None:
    linear = Linear(torch.tensor([[[1.0, 2.0], [3.0, 4.0]]]), torch.tensor([[0.5, -0.5]]))
    assert torch.equal(linear.forward(torch.tensor([[1.0, -1.0]]))[0], torch.tensor([[-0.5, -1.5]]))
