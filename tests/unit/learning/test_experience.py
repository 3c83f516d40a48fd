"""From actions to a transition, against a loop by hand; and outcome models that have learned nothing."""

from collections.abc import Iterator

import numpy as np
import pytest

from mimo.learning import rewards
from mimo.learning.experience import Experience, initial_quantiles, untaught
from mimo.learning.outcomes import Outcomes
from mimo.learning.rewards import Transition
from mimo.record import streams
from mimo.settings import params
from mimo.settings.params import Params
from mimo.vision.extractor import Extractor, Trained
from mimo.world import scene
from mimo.world.eye import Eye
from mimo.world.physics import Worlds
from tests.unit.learning.recorded import Runs

SEEDS, STEPS = (0, 3), 4


def generators(p: Params, purpose: str) -> list[np.random.Generator]:
    return [streams.generator(p.seed, "noisy", seed, purpose) for seed in SEEDS]


def actions() -> Iterator[tuple[np.ndarray, np.ndarray, bool]]:
    """Which joints move, the directions, and whether the rope is on."""
    draw = np.random.default_rng(1)
    for step in range(STEPS):
        yield draw.random((2, 12)) < 0.4, draw.random((2, 12)) < 0.5, step > 1


@pytest.fixture(scope="module")
def built(tiny: Params) -> scene.Scene:
    return scene.build(tiny.world, tiny.protocol)


@pytest.fixture(scope="module")
def eye(built: scene.Scene) -> Iterator[Eye]:
    with Eye(built) as made:
        yield made


def new_worlds(p: Params, built: scene.Scene) -> Worlds:
    return Worlds(built, p.protocol, 40.0, generators(p, "noise"))


def same(one: np.ndarray | None, other: np.ndarray | None) -> bool:
    assert one is not None
    assert other is not None
    return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()


def test_a_transition_is_what_a_loop_by_hand_gives(
    tiny: Params, trained: Trained, built: scene.Scene, eye: Eye
) -> None:
    """Bitwise; what is expected of an action, and its influence, are from before the models learned of its outcome."""
    extract = Extractor(tiny.encoder, trained)
    experience = Experience(
        new_worlds(tiny, built), eye, extract, untaught(tiny, trained, "noisy", generators(tiny, "memory"))
    )
    worlds = new_worlds(tiny, built)
    outcomes = Outcomes(tiny.outcomes, initial_quantiles(tiny, trained, "noisy"), generators(tiny, "memory"))
    latent = extract(eye.frames(worlds.qpos))
    assert same(experience.perception.latent, latent)
    for moved, positive, attached in actions():
        outcome, found = experience.step(moved, positive, attached)
        seen = worlds.step(moved, positive, attached)
        before, latent = latent, extract(eye.frames(worlds.qpos))
        influence, expectation = outcomes.influence(), outcomes.expectation(moved)
        outcomes.update(moved, latent)
        assert outcome.proprioception.tobytes() == seen.proprioception.tobytes()
        assert outcome.path_length.tobytes() == seen.path_length.tobytes()
        assert outcome.centre_of_mass.tobytes() == seen.centre_of_mass.tobytes()
        assert same(found.path_length, seen.path_length.astype(np.float32))
        assert same(found.action, moved)
        assert same(found.latent_before, before)
        assert same(found.latent, latent)
        assert same(experience.perception.latent, latent)
        assert same(found.influence, influence)
        assert same(found.expectation, expectation)
        assert not same(found.influence, outcomes.influence())  # it would show, had the models learned first
        assert not same(found.expectation, outcomes.expectation(moved))
        assert not same(latent[0], latent[1])
        assert not same(before, latent)


def test_without_outcome_models_the_transition_is_the_same_but_for_them(
    tiny: Params, trained: Trained, built: scene.Scene, eye: Eye
) -> None:
    extract = Extractor(tiny.encoder, trained)
    outcomes = untaught(tiny, trained, "noisy", generators(tiny, "memory"))
    bare, whole = (Experience(new_worlds(tiny, built), eye, extract, models) for models in (None, outcomes))
    for moved, positive, attached in actions():
        found: Transition = bare.step(moved, positive, attached)[1]
        other = whole.step(moved, positive, attached)[1]
        assert found.influence is found.expectation is None
        for name in ("path_length", "latent_before", "latent", "action"):
            assert same(getattr(found, name), getattr(other, name))


def test_outcome_models_start_at_the_quantiles_of_h(tiny: Params, trained: Trained, runs: Runs) -> None:
    start = initial_quantiles(tiny, trained, "noisy")
    assert start.shape == (64, 49)
    assert start.dtype == np.float32
    # 0.02, 0.04, ...: every second of the kept 0.01, 0.02, ...
    assert start == pytest.approx(trained.quantiles[2][:, 1::2], abs=1e-6)  # noisy, rope off
    other = initial_quantiles(tiny, trained, "free")
    assert other == pytest.approx(trained.quantiles[0][:, 1::2], abs=1e-6)
    assert (other != start).any()
    nothing = tiny.model_copy(update={"outcomes": params.checked(tiny.outcomes, {"start": "zero"})})
    assert not initial_quantiles(nothing, trained, "noisy").any()
    assert same(
        untaught(tiny, trained, "noisy", generators(tiny, "memory")).marginal, np.broadcast_to(start, (2, 64, 49))
    )
    for record in runs("noisy", "cais", 0, 1):
        assert not record["influence"][0].any()  # all tables alike


def test_more_pictures_of_a_step_are_what_is_seen_on_the_way(
    tiny: Params, trained: Trained, built: scene.Scene, eye: Eye
) -> None:
    extract = Extractor(tiny.encoder, trained)
    whole = Experience(new_worlds(tiny, built), eye, extract)
    four = params.changed(tiny, {"rewards.rtl.frames": 4}).rewards
    parts = Experience(new_worlds(tiny, built), eye, extract, terms=rewards.parts("mtl_rtl", four))
    worlds = new_worlds(tiny, built)
    for moved, positive, attached in actions():
        (one, seen), (other, more) = (e.step(moved, positive, attached) for e in (whole, parts))
        between = [extract(eye.frames(worlds.qpos)) for _ in worlds.pieces(moved, positive, attached, [30, 60, 90])]
        assert one.centre_of_mass.tobytes() == other.centre_of_mass.tobytes()
        np.testing.assert_allclose(one.path_length, other.path_length, rtol=1e-6)
        assert more.latents.shape == (2, 5, 64)
        assert same(more.latents[:, 1:], np.stack(between, axis=1))
        assert same(more.latents[:, [0, -1]], seen.latents)
        assert (np.diff(more.latents, axis=1) != 0).any(axis=(0, 2)).all()
