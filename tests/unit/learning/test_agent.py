"""The agent's kernels against hand-worked numbers, and against torch's own modules, autograd and AdamW in float64."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from scipy import stats
from torch import nn

from mimo.learning import network
from mimo.learning.agent import Agents, move_probability, sarsa_target
from mimo.learning.network import Network
from mimo.settings import params
from tests.unit.learning.twins import policy, q_network, td_loss

INPUTS, HIDDEN, JOINTS = 111, 64, 12
SETTINGS = params.Agent(
    hidden=HIDDEN, learning_rate=0.001, gamma=0.1, temperature=0.3, move_bias=-0.2, bias_in_target=False
)
Q = st.floats(-5, 5, width=32)


def agents(seeds: Sequence[int], in_target: bool = False) -> Agents:
    settings = SETTINGS.model_copy(update={"bias_in_target": in_target})
    return Agents(settings, INPUTS, [np.random.default_rng((seed, 0)) for seed in seeds])


def normal(generator: np.random.Generator, *shape: int) -> np.ndarray:
    return generator.normal(size=shape).astype(np.float32)


def parts(net: Network) -> list[np.ndarray]:
    """All parameters, in the order of torch's module."""
    inner = [part for residual in net.residuals for layer in residual for part in layer]
    return [*net.inlet, *net.inlet_norm, *inner, *net.outlet_norm, *net.outlet]


def twin(net: Network) -> nn.Sequential:
    """Torch's module with the same weights."""
    width, inputs = net.inlet.weight.shape
    module = q_network(inputs, width)
    for ours, theirs in zip(parts(net), module.parameters(), strict=True):
        theirs.data.copy_(torch.from_numpy(ours))
    return module


def chances(values: np.ndarray, bias: float = -0.2, temperature: float = 0.3) -> np.ndarray:
    f = np.float32
    return np.array([move_probability(f(rest), f(move), f(bias), f(temperature)) for rest, move in values])


def test_policy_by_hand() -> None:
    found = chances(np.array([[0.0, 0.2], [0.3, 0.5 + 0.3 * math.log(3)], [0.0, 60.0], [60.0, 0.0]]))
    np.testing.assert_allclose(found, [0.5, 0.75, 1, 0], atol=1e-6)


@given(st.lists(st.tuples(Q, Q), min_size=1, max_size=20), Q, st.floats(0.05, 5))
def test_policy_is_torchs_softmax(pairs: list[tuple[float, float]], bias: float, temperature: float) -> None:
    expected = policy(torch.tensor(pairs, dtype=torch.float64), bias, temperature)[:, 1]
    np.testing.assert_allclose(chances(np.array(pairs), bias, temperature), expected, rtol=1e-4, atol=1e-6)


def test_sarsa_target_by_hand() -> None:
    target = sarsa_target(*map(np.float32, (0.5, 1.0, 3.0, 0.25, 0.1)))
    assert target == pytest.approx(0.65)  # 0.5 + 0.1 * (0.75 * 1 + 0.25 * 3)


@pytest.mark.parametrize("in_target", [False, True])
def test_update_returns_the_td_error_with_the_bias_in_policy_and_where_asked_for_in_the_target(in_target: bool) -> None:
    three, generator = agents([1, 2, 3], in_target), np.random.default_rng(0)
    state, following = normal(generator, 3, INPUTS), normal(generator, 3, INPUTS)
    reward, action = normal(generator, 3, JOINTS), normal(generator, 3, JOINTS) > 0
    then, now = three.values(following).astype(float), three.values(state).astype(float)
    move = 1 / (1 + np.exp(-(then[..., 1] - 0.2 - then[..., 0]) / 0.3))
    taken = np.where(action, now[..., 1], now[..., 0])
    worth = then[..., 1] - 0.2 if in_target else then[..., 1]
    expected = reward + 0.1 * (move * worth + (1 - move) * then[..., 0]) - taken
    np.testing.assert_allclose(three.move_probability(then.astype(np.float32)), move, rtol=1e-6)
    np.testing.assert_allclose(three.update(action, reward, following), expected, atol=1e-5)


def test_weights_start_as_in_torch() -> None:
    two = agents([5, 6])
    for net in two.networks:
        for linear in (net.inlet, net.residuals[0].linear, net.residuals[1].linear, net.outlet):
            bound = 1 / math.sqrt(linear.weight.shape[1])
            drawn = np.concatenate([part.ravel() for part in linear])
            assert stats.kstest(drawn, stats.uniform(-bound, 2 * bound).cdf).pvalue > 0.001
        for norm in (net.inlet_norm, *(residual.norm for residual in net.residuals), net.outlet_norm):
            assert (norm.weight == 1).all()
            assert not norm.bias.any()
    assert (two.networks[0].inlet.weight != two.networks[1].inlet.weight).all()


@given(inputs=st.integers(1, 40), width=st.integers(1, 40))
def test_every_parameter_has_its_own_place(inputs: int, width: int) -> None:
    numbers = np.arange(network.size(inputs, width), dtype=np.float32)
    net = network.over(numbers, inputs, width)
    assert [part.shape for part in parts(net)] == [tuple(theirs.shape) for theirs in twin(net).parameters()]
    assert (np.concatenate([part.ravel() for part in parts(net)]) == numbers).all()
    assert all(np.shares_memory(part, numbers) for part in parts(net))


@given(inputs=st.integers(1, 130), width=st.integers(2, 70), seed=st.integers(0, 99))
@examples(max_examples=40, deadline=None)
def test_values_and_gradients_are_those_of_torch(inputs: int, width: int, seed: int) -> None:
    size, generator = network.size(inputs, width), np.random.default_rng(seed)
    net = network.over(normal(generator, size) / 3, inputs, width)
    gradient = network.over(np.full(size, np.nan, np.float32), inputs, width)
    state, upstream = normal(generator, inputs), normal(generator, JOINTS * 2)
    kept, module = network.trace(inputs, width), twin(net)
    values = network.forward(net, state, kept)
    network.backward(net, kept, upstream, gradient)
    output = module(torch.from_numpy(state).double()[None])[0]
    output.backward(torch.from_numpy(upstream).double().view(JOINTS, 2))
    np.testing.assert_allclose(values, output.detach().numpy().ravel(), rtol=1e-3, atol=1e-4)
    for ours, theirs in zip(parts(gradient), module.parameters(), strict=True):
        assert theirs.grad is not None
        largest = max(1.0, float(theirs.grad.abs().max()))
        np.testing.assert_allclose(ours, theirs.grad.numpy(), rtol=1e-3, atol=2e-4 * largest)


@pytest.mark.parametrize("in_target", [False, True])
def test_updates_follow_torchs_adamw_on_single_modules(in_target: bool) -> None:
    two, generator = agents([8, 9], in_target), np.random.default_rng(2)
    policy_and_target = (-0.2, 0.3), -0.2 if in_target else 0.0
    modules = [twin(net) for net in two.networks]
    optimizers = [torch.optim.AdamW(module.parameters(), lr=0.001) for module in modules]
    for _ in range(25):
        state, following = normal(generator, 2, INPUTS), normal(generator, 2, INPUTS)
        reward, action = normal(generator, 2, JOINTS), normal(generator, 2, JOINTS) > 0
        two.values(state)
        two.update(action, reward, following)
        for seed, (module, optimizer) in enumerate(zip(modules, optimizers, strict=True)):
            now, then, paid = (torch.from_numpy(x[seed : seed + 1]).double() for x in (state, following, reward))
            optimizer.zero_grad()
            taken = torch.from_numpy(action[seed : seed + 1])
            td_loss(module, now, taken, paid, then, 0.1, *policy_and_target).backward()
            optimizer.step()
    for net, module in zip(two.networks, modules, strict=True):
        for ours, theirs in zip(parts(net), module.parameters(), strict=True):
            np.testing.assert_allclose(ours, theirs.detach().numpy(), atol=5e-5, rtol=0)  # decay alone: 2.5e-4


def test_values_arrive_at_a_constant_reward() -> None:
    one, generator = agents([4]), np.random.default_rng(3)
    for _ in range(600):
        one.values(normal(generator, 1, INPUTS))
        one.update(
            generator.random((1, JOINTS)) < 0.5, np.full((1, JOINTS), 0.9, np.float32), normal(generator, 1, INPUTS)
        )
    values = np.concatenate([one.values(normal(generator, 1, INPUTS)) for _ in range(50)])
    np.testing.assert_allclose(values.mean(0), np.ones((JOINTS, 2)), atol=0.15)  # 0.9 / (1 - 0.1)


def test_nothing_hides_a_nan() -> None:
    two, generator = agents([1, 2]), np.random.default_rng(4)
    reward = np.zeros((2, JOINTS), np.float32)
    reward[0, 3] = np.nan
    two.values(normal(generator, 2, INPUTS))
    error = two.update(np.ones((2, JOINTS), bool), reward, normal(generator, 2, INPUTS))
    assert np.isnan(error[0, 3])
    after = two.values(normal(generator, 2, INPUTS))
    assert np.isnan(after[0]).all()
    assert np.isnan(two.move_probability(after)[0]).all()
    assert np.isfinite(after[1]).all()


def history(seeds: Sequence[int], steps: int) -> dict[int, bytes]:
    """All that the agents of `seeds` give over `steps` updates, in bytes."""
    stack, worlds = agents(seeds), [np.random.default_rng((seed, 1)) for seed in seeds]

    def draw(size: int) -> np.ndarray:
        return np.stack([world.normal(size=size) for world in worlds]).astype(np.float32)

    state, seen = draw(INPUTS), dict.fromkeys(seeds, b"")
    for _ in range(steps):
        values = stack.values(state)
        probability = stack.move_probability(values)
        state = draw(INPUTS)
        error = stack.update(draw(JOINTS) < probability, draw(JOINTS), state)
        for place, seed in enumerate(seeds):
            seen[seed] += b"".join(part[place].tobytes() for part in (values, probability, error))
    return seen


def test_a_seeds_bytes_do_not_depend_on_its_companions() -> None:
    whole = history(range(10), 250)
    assert len(set(whole.values())) == 10
    for seeds in ([0], [7], [9, 7], [3, 4, 5], [8, 7, 1, 0, 2]):
        for seed, seen in history(seeds, 250).items():
            assert seen == whole[seed], f"seed {seed} among {seeds}"


def test_a_value_once_given_is_not_changed_by_what_follows() -> None:
    one, generator = agents([1]), np.random.default_rng(0)
    first = one.values(normal(generator, 1, INPUTS))
    before = first.copy()
    one.values(normal(generator, 1, INPUTS))
    assert (first == before).all()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"reward": np.zeros((1, 1), np.float32)}, r"^reward must be \(1, 12\) of float32; it is \(1, 1\) of float32"),
        ({"reward": np.zeros((1, JOINTS))}, r"^reward must be \(1, 12\) of float32; it is \(1, 12\) of float64"),
        ({"action": np.full((1, JOINTS), 7)}, r"^action must be \(1, 12\) of bool; it is \(1, 12\) of int64"),
        ({"next_state": np.zeros((1, 3), np.float32)}, r"^next_state must be \(1, 111\) of float32"),
    ],
)
def test_what_would_be_read_beyond_its_end_is_refused(changed: dict[str, np.ndarray], message: str) -> None:
    one = agents([0])
    state, still = np.zeros((1, INPUTS), np.float32), np.zeros((1, JOINTS), bool)
    one.values(state)
    given = {"action": still, "reward": np.zeros((1, JOINTS), np.float32), "next_state": state}
    with pytest.raises(ValueError, match=message):
        one.update(**given | changed)
    one.update(**given)  # what was refused has not used up the values
    with pytest.raises(ValueError, match=r"^state must be"):
        one.values(state[:, :-1])


def test_an_update_without_its_values_is_refused() -> None:
    """It would learn from a state of which nothing is known."""
    one, state = agents([0]), np.zeros((1, INPUTS), np.float32)
    given = (np.zeros((1, JOINTS), bool), np.zeros((1, JOINTS), np.float32), state)
    one.values(state)
    one.update(*given)
    with pytest.raises(RuntimeError, match=r"^Ask for the values"):
        one.update(*given)
