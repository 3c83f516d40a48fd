"""Outcome models against scipy, numpy, the paper's loss under autograd in float64 and torch's AdamW."""

from collections.abc import Sequence

import numpy as np
import pytest
import torch
from hypothesis import example, given
from hypothesis import settings as examples
from hypothesis import strategies as st
from scipy import stats

from mimo.learning.outcomes import CONDITIONAL, MARGINAL, Outcomes, taus
from mimo.settings import params
from mimo.world import body
from tests.unit.learning.twins import huber, quantile_loss

JOINTS, LATENT, QUANTILES = 12, 64, 49
Remembered = tuple[np.ndarray, np.ndarray]  # action, and the h that followed


def settings(**changes: float | str) -> params.Outcomes:
    defaults: dict[str, float | str] = {
        "quantiles": QUANTILES, "kappa": 1.0, "learning_rate": 0.001, "batches": "own", "batch": 8, "memory": 500,
        "action": "joint", "marginal": "table", "start": "detached",
    }  # fmt: skip
    return params.Outcomes.model_validate(defaults | changes)


def initial(latent: int = LATENT, quantiles: int = QUANTILES) -> np.ndarray:
    """Normal quantiles of SD 0.3, each dimension at its own place."""
    levels = stats.norm.ppf(taus(quantiles).astype(float)) * 0.3
    return (levels + np.linspace(-0.5, 0.5, latent)[:, None]).astype(np.float32)


def test_taus() -> None:
    np.testing.assert_allclose(taus(49), np.arange(0.02, 0.99, 0.02), rtol=1e-6)
    np.testing.assert_allclose(taus(1), [0.5])


def test_the_reference_loss_by_hand() -> None:
    u, tau = torch.tensor([-3.0, -0.5, 0.0, 0.5, 1.0, 3.0]), torch.tensor([0.1, 0.9])
    assert torch.equal(huber(u, 1.0), torch.tensor([2.5, 0.125, 0.0, 0.125, 0.5, 2.5]))
    torch.testing.assert_close(quantile_loss(torch.tensor(3.0), torch.zeros(2), tau, 1.0), 2.5 * tau)
    torch.testing.assert_close(quantile_loss(torch.tensor(-0.5), torch.zeros(2), tau, 1.0), 0.125 * (1 - tau))


def test_tables_start_at_initial() -> None:
    outcomes = Outcomes(settings(), initial(), [np.random.default_rng(0), np.random.default_rng(1)])
    assert outcomes.conditional.shape == (2, JOINTS, 2, LATENT, QUANTILES)
    assert (outcomes.conditional == initial()).all()
    assert outcomes.marginal.shape == (2, LATENT, QUANTILES)
    assert (outcomes.marginal == initial()).all()
    assert (outcomes.influence() == np.zeros((2, JOINTS, 2))).all()
    with pytest.raises(ValueError, match="initial has 7 quantiles"):
        Outcomes(settings(), initial(LATENT, 7), [np.random.default_rng(0)])


def test_influence_and_expectation_against_scipy() -> None:
    outcomes, generator = Outcomes(settings(), initial(), [np.random.default_rng(0)] * 2), np.random.default_rng(1)
    for table in (outcomes.conditional, outcomes.marginal):
        table[:] = np.sort(generator.normal(size=table.shape))
    action = generator.random((2, JOINTS)) < 0.5
    influence, expectation = outcomes.influence(), outcomes.expectation(action)
    assert influence.shape == (2, JOINTS, 2)
    assert expectation.shape == (2, JOINTS, LATENT)
    for seed, joint, move in ((0, 0, 0), (0, 7, 1), (1, 11, 1), (1, 4, 0)):
        pairs = zip(outcomes.conditional[seed, joint, move], outcomes.marginal[seed], strict=True)
        expected = np.mean([stats.wasserstein_distance(of_action, of_all) for of_action, of_all in pairs])
        np.testing.assert_allclose(influence[seed, joint, move], expected, rtol=1e-5)
        mean = outcomes.conditional[seed, joint, int(action[seed, joint])].astype(float).mean(-1)
        np.testing.assert_allclose(expectation[seed, joint], mean, atol=1e-6, rtol=1e-5)


LEFT_FOOT = body.attached("left_foot")


def one_knee(action: str, **changes: float | str) -> tuple[Outcomes, np.ndarray]:
    """Models of one number at 0, and the action in which the left knee alone moves."""
    chosen = settings(action=action, quantiles=1, batch=2, **changes)
    return Outcomes(chosen, np.zeros((1, 1), np.float32), [np.random.default_rng(0)]), (
        np.array(body.ACTUATED) == "left_knee"
    )[None]


@pytest.mark.parametrize("batches", ["own", "shared"])
def test_a_joints_action_may_be_its_limbs(batches: str) -> None:
    """By hand: AdamW's first step moves what learns by its rate, 0.001, towards h = 1."""
    for action, moves in (("limb", LEFT_FOOT), ("joint", np.array(body.ACTUATED) == "left_knee")):
        outcomes, knee = one_knee(action, batches=batches)
        outcomes.update(knee, np.ones((1, 1), np.float32))
        rows = outcomes.conditional[0, ..., 0, 0]  # joint, action
        np.testing.assert_allclose(rows[:, 1], np.where(moves, 0.001, 0), rtol=1e-4)
        np.testing.assert_allclose(rows[:, 0], np.where(moves, 0, 0.001), rtol=1e-4)
        np.testing.assert_allclose(outcomes.marginal, 0.001, rtol=1e-4)
        # W1 to p(h) is of the tables that have not learned; every joint's own action has.
        np.testing.assert_allclose(outcomes.influence()[0, :, 1], np.where(moves, 0, 0.001), rtol=1e-4, atol=1e-9)
        np.testing.assert_allclose(outcomes.influence()[0, :, 0], np.where(moves, 0.001, 0), rtol=1e-4, atol=1e-9)
        np.testing.assert_allclose(outcomes.expectation(knee)[0], 0.001, rtol=1e-4)
        assert LEFT_FOOT.sum() == 3


def test_what_is_expected_of_a_resting_joint_is_what_its_limb_does() -> None:
    number = np.arange(1.0, 13)
    for action, moves in (("limb", LEFT_FOOT), ("joint", np.array(body.ACTUATED) == "left_knee")):
        outcomes, knee = one_knee(action)
        outcomes.conditional[0, :, 1, 0, 0], outcomes.conditional[0, :, 0, 0, 0] = number, -number
        assert outcomes.expectation(knee)[0, :, 0].tolist() == np.where(moves, number, -number).tolist()
        assert outcomes.expectation(np.zeros_like(knee))[0, :, 0].tolist() == (-number).tolist()
        assert outcomes.expectation(np.ones_like(knee))[0, :, 0].tolist() == number.tolist()


def test_the_policys_mixture_for_a_limb_is_by_whether_any_of_its_joints_moves() -> None:
    """By hand: .5, .2 and .1 make 1 - .5 .8 .9 = .64; W1 of the two tables is 1."""
    probability = np.full((1, JOINTS), 0.5, np.float32)
    probability[0, LEFT_FOOT] = [0.5, 0.2, 0.1]
    own = {"joint": probability[0].astype(float), "limb": np.where(LEFT_FOOT, 0.64, 1 - 0.5**3)}
    for action, expected in own.items():
        outcomes, _ = one_knee(action, marginal="policy")
        outcomes.conditional[0, :, 1] = 1
        np.testing.assert_allclose(outcomes.influence(probability)[0, :, 0], expected, rtol=1e-6)
        np.testing.assert_allclose(outcomes.influence(probability)[0, :, 1], 1 - expected, rtol=1e-6)


@given(
    action=st.sampled_from(["joint", "limb"]),
    kappa=st.sampled_from([1.0, 0.1]),
    latent=st.integers(1, 70),
    quantiles=st.integers(1, 60),
    memory=st.integers(1, 9),
    batch=st.integers(1, 9),
    batches=st.sampled_from(["own", "shared"]),
)
@example(action="limb", kappa=1.0, latent=LATENT, quantiles=QUANTILES, memory=5, batch=8, batches="own")
@example(action="joint", kappa=0.1, latent=LATENT, quantiles=QUANTILES, memory=5, batch=8, batches="shared")
@examples(max_examples=16, deadline=None)
def test_updates_follow_autograd_and_torchs_adamw(
    action: str, kappa: float, latent: int, quantiles: int, memory: int, batch: int, batches: str
) -> None:
    """Batches are drawn as the docstring of `update` says, here table by table."""
    chosen = settings(action=action, kappa=kappa, memory=memory, quantiles=quantiles, batch=batch, batches=batches)
    start = initial(latent, quantiles)
    outcomes, twin, world = Outcomes(chosen, start, [np.random.default_rng(3)]), *map(np.random.default_rng, (3, 4))
    conditional = torch.from_numpy(start).double().repeat(JOINTS, 2, 1, 1).requires_grad_()
    marginal = torch.from_numpy(start).double().requires_grad_()
    optimizer = torch.optim.AdamW([conditional, marginal], lr=0.001)
    tau, remembered = torch.from_numpy(taus(quantiles)).double(), list[Remembered]()
    for step in range(20):
        moved, h = world.random(JOINTS) < 0.4, (world.normal(size=latent) * 0.5).astype(np.float32)
        outcomes.update(moved[None], h[None])
        acted = moved
        if action == "limb":
            acted = np.max([own & moved[own].any() for own in map(body.attached, body.LIMB_JOINTS)], axis=0)
        if step < memory:
            remembered.append((acted, h))
        else:
            remembered[step % memory] = (acted, h)  # the oldest makes room
        if batches == "own":
            chance = twin.random((MARGINAL + 1, batch))
        else:
            common = [remembered[place] for place in twin.integers(0, len(remembered), batch)]
        loss = torch.zeros((), dtype=torch.float64)
        for row, q in enumerate([*conditional.flatten(0, 1), marginal]):
            joint, move = divmod(row, 2)

            def fits(of: list[Remembered], row: int = row, joint: int = joint, move: int = move) -> list[Remembered]:
                return [each for each in of if row == MARGINAL or each[0][joint] == move]

            if batches == "own":
                fitting = fits(remembered)
                drawn = [fitting[int(c * len(fitting))] for c in chance[row] if fitting]
            else:
                drawn = fits(common)
            if drawn:
                y = torch.from_numpy(np.stack([after for _, after in drawn])).double()[..., None]
                loss = loss + quantile_loss(y, q, tau, kappa).sum() / batch
        optimizer.zero_grad()
        loss.backward()
        assert conditional.grad is not None
        assert marginal.grad is not None
        gradient = outcomes._gradient[0].swapaxes(-1, -2)
        np.testing.assert_allclose(gradient[:CONDITIONAL], conditional.grad.flatten(0, 1), atol=1e-4)
        np.testing.assert_allclose(gradient[MARGINAL], marginal.grad, atol=1e-4)
        optimizer.step()
    np.testing.assert_allclose(outcomes.conditional[0], conditional.detach(), atol=2e-5)
    np.testing.assert_allclose(outcomes.marginal[0], marginal.detach(), atol=2e-5)


def test_with_the_policys_mixture_influence_is_w1_to_a_weighted_sample() -> None:
    outcomes = Outcomes(settings(marginal="policy"), initial(), [np.random.default_rng(0)] * 2)
    generator = np.random.default_rng(1)
    outcomes.conditional[:] = np.sort(generator.normal(size=outcomes.conditional.shape))
    probability = generator.random((2, JOINTS), np.float32)
    influence = outcomes.influence(probability)
    assert influence.shape == (2, JOINTS, 2)
    assert influence.dtype == np.float32
    for seed, joint, action in ((0, 0, 0), (0, 3, 1), (1, 3, 1), (1, 11, 0)):
        both, p = outcomes.conditional[seed, joint], float(probability[seed, joint])
        weights = np.repeat([1 - p, p], QUANTILES)
        expected = np.mean([
            stats.wasserstein_distance(both[action, d], both[:, d].ravel(), v_weights=weights) for d in range(LATENT)
        ])  # fmt: skip
        np.testing.assert_allclose(influence[seed, joint, action], expected, rtol=1e-4)


def test_the_policys_mixture_needs_the_policy() -> None:
    outcomes = Outcomes(settings(marginal="policy"), initial(), [np.random.default_rng(0)])
    with pytest.raises(
        ValueError, match=r"^With outcomes\.marginal `policy`, influence needs P\(MOVE\); there is none"
    ):
        outcomes.influence()
    for wrong in (np.zeros((1, JOINTS)), np.zeros((1, 1), np.float32)):
        with pytest.raises(ValueError, match=r"^probability must be \(1, 12\) of float32; it is"):
            outcomes.influence(wrong)
    assert not outcomes.influence(np.full((1, JOINTS), 0.3, np.float32)).any()  # all tables alike
    table = Outcomes(settings(), initial(), [np.random.default_rng(0)])
    table.marginal[:] += 1
    assert (table.influence(np.zeros((1, JOINTS), np.float32)) == table.influence()).all()  # is not read


def test_all_tables_move_at_one_pace_with_batches_of_their_own() -> None:
    """After a shift of h in which no action has a part; with one batch for all, p(h) runs ahead."""
    apart = {}
    for batches in ("own", "shared"):
        outcomes = Outcomes(settings(batches=batches, memory=200), initial(), [np.random.default_rng(0)])
        world = np.random.default_rng(1)
        for step in range(300):
            h = world.normal(size=(1, LATENT)) * 0.3 + (0 if step < 150 else 1)
            outcomes.update(world.random((1, JOINTS)) < 0.3, h.astype(np.float32))
        apart[batches] = outcomes.influence()[0, :, 1].mean()
    assert apart["own"] < 0.5 * apart["shared"]


@pytest.mark.parametrize("batches", ["own", "shared"])
@pytest.mark.parametrize("kappa", [0.01, 50.0])
def test_tables_arrive_at_what_the_loss_asks_for(kappa: float, batches: str) -> None:
    """Small kappa: the quantiles of the data. Kappa above every |u|: their expectiles (Newey & Powell 1987)."""
    size, levels = 400, taus(9).astype(float)
    chosen = settings(quantiles=9, kappa=kappa, learning_rate=0.004, batches=batches, batch=64, memory=size)
    outcomes, world = Outcomes(chosen, initial(2, 9), [np.random.default_rng(0)]), np.random.default_rng(1)
    moved = world.random((size, JOINTS)) < 0.4
    data = np.column_stack([world.normal(size=size), world.exponential(size=size)]) * 0.3 + 0.6 * moved[:, :1]
    mean = np.zeros((JOINTS * 2 + 1, 2, 9))
    steps, kept = 1600, 400
    for step in range(steps):
        outcomes.update(moved[None, step % size], data[None, step % size].astype(np.float32))
        if step >= steps - kept:
            mean += np.concatenate([outcomes.conditional[0].reshape(-1, 2, 9), outcomes.marginal]) / kept

    def wanted(values: np.ndarray) -> np.ndarray:
        if kappa < 1:
            return np.quantile(values, levels, axis=0).T
        return np.array([[stats.expectile(column, level) for level in levels] for column in values.T])

    for joint, move in ((0, 0), (0, 1), (5, 1)):
        expected = wanted(data[moved[:, joint] == move])
        np.testing.assert_allclose(mean[2 * joint + move], expected, atol=0.05)
    np.testing.assert_allclose(mean[-1], wanted(data), atol=0.05)
    influence = outcomes.influence()[0, :, 1]
    after_move = [wanted(data[moved[:, joint]]) for joint in range(JOINTS)]
    np.testing.assert_allclose(influence, [np.abs(each - wanted(data)).mean() for each in after_move], atol=0.02)
    assert influence[0] > 4 * influence[1:].max()  # joint 0 alone shifts h; by chance others went with it in the data


OTHER = {"action": "limb", "batches": "shared", "marginal": "policy"}  # readings of the paper


def history(seeds: Sequence[int], steps: int, **changes: str) -> dict[int, bytes]:
    """All that the models of `seeds` give over `steps` updates, in bytes."""
    stack = Outcomes(settings(memory=60, **changes), initial(), [np.random.default_rng((seed, 0)) for seed in seeds])
    worlds, seen = [np.random.default_rng((seed, 1)) for seed in seeds], dict.fromkeys(seeds, b"")
    for _ in range(steps):
        action = np.stack([world.random(JOINTS) < 0.4 for world in worlds])
        latent = np.stack([world.normal(size=LATENT) * 0.5 for world in worlds]).astype(np.float32)
        probability = np.stack([world.random(JOINTS, np.float32) for world in worlds])
        given = (stack.influence(probability), stack.expectation(action))
        stack.update(action, latent)
        for place, seed in enumerate(seeds):
            seen[seed] += b"".join(part[place].tobytes() for part in given)
    for place, seed in enumerate(seeds):
        seen[seed] += stack.conditional[place].tobytes() + stack.marginal[place].tobytes()
    return seen


@pytest.mark.parametrize("changes", [{}, OTHER], ids=str)
def test_a_seeds_bytes_do_not_depend_on_its_companions(changes: dict[str, str]) -> None:
    whole = history(range(10), 200, **changes)
    assert len(set(whole.values())) == 10
    for seeds in ([0], [7, 9], [8, 7, 1, 0, 2]):
        for seed, seen in history(seeds, 200, **changes).items():
            assert seen == whole[seed], f"seed {seed} among {seeds}"


def test_what_would_be_read_beyond_its_end_is_refused() -> None:
    outcomes = Outcomes(settings(), initial(), [np.random.default_rng(0)])
    still, latent = np.zeros((1, JOINTS), bool), np.zeros((1, LATENT), np.float32)
    with pytest.raises(ValueError, match=r"^action must be \(1, 12\) of bool; it is \(1, 12\) of int64\.$"):
        outcomes.update(np.full((1, JOINTS), 7), latent)
    with pytest.raises(ValueError, match=r"^latent must be \(1, 64\) of float32; it is \(1, 63\) of float32\.$"):
        outcomes.update(still, latent[:, 1:])
    with pytest.raises(ValueError, match=r"^action must be \(1, 12\) of bool; it is \(1, 11\) of bool\.$"):
        outcomes.expectation(still[:, 1:])
