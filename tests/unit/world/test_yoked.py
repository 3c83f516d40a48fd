"""Infants under mobiles that others have moved: the mobile is the donor's, to the bit, the body the infant's own."""

from collections.abc import Iterator

import numpy as np
import pytest

from mimo.settings import params
from mimo.world import body, scene
from mimo.world.eye import Eye
from mimo.world.physics import Worlds
from mimo.world.yoked import Yoked

P = params.load()
STEPS, TIED = 5, range(2, 4)
ARMS = ("shoulder", "elbow", "hand", "fingers")
Actions = tuple[np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def built() -> scene.Scene:
    return scene.build(P.world, P.protocol)


@pytest.fixture(scope="module")
def eye(built: scene.Scene) -> Iterator[Eye]:
    with Eye(built) as made:
        yield made


@pytest.fixture(scope="module")
def donated() -> Actions:
    """The donors' actions and directions: (steps, 2, 12)."""
    draw = np.random.default_rng(7)
    return draw.random((STEPS, 2, 12)) < 0.5, draw.random((STEPS, 2, 12)) < 0.5


def worlds(built: scene.Scene, force: float, *seeds: int) -> Worlds:
    return Worlds(built, P.protocol, force, [np.random.default_rng(seed) for seed in seeds])


def yoked(built: scene.Scene, force: float, donated: Actions) -> Yoked:
    """Seeds 0 and 1 under the mobiles of seeds 5 and 6."""
    return Yoked(worlds(built, 0.0, 0, 1), worlds(built, force, 5, 6), *donated)


def own_actions() -> Iterator[Actions]:
    draw = np.random.default_rng(3)
    for _ in range(STEPS):
        yield draw.random((2, 12)) < 0.5, draw.random((2, 12)) < 0.5


def mobile(built: scene.Scene, qpos: np.ndarray) -> np.ndarray:
    """(N, 4) the quaternion by which it hangs."""
    first = built.model.joint("suspension").qposadr[0]
    return qpos[:, first : first + 4]


def limbs(built: scene.Scene, qpos: np.ndarray) -> bytes:
    """All but the mobile."""
    first = built.model.joint("suspension").qposadr[0]
    return np.delete(qpos, range(first, first + 4), axis=1).tobytes()


@pytest.mark.parametrize("count", [1, 4])
@pytest.mark.parametrize("force", [0.0, 40.0])
def test_the_mobile_is_the_donors_and_the_body_its_own(
    force: float, count: int, built: scene.Scene, donated: Actions
) -> None:
    """Against both worlds apart, piece by piece; the infants' rope is never on."""
    together, theirs, mine = yoked(built, force, donated), worlds(built, force, 5, 6), worlds(built, 0.0, 0, 1)
    assert together.size == 2
    for step, (moved, positive) in enumerate(own_actions()):
        tied = step in TIED
        pieces = together.parts(moved, positive, tied, count)
        apart = (theirs.parts(donated[0][step], donated[1][step], tied, count),
                 mine.parts(moved, positive, False, count))  # fmt: skip
        for seen, of_donor, of_own in zip(pieces, *apart, strict=True):
            assert seen.path_length.tobytes() == of_donor.path_length.tobytes()
            assert seen.centre_of_mass.tobytes() == of_donor.centre_of_mass.tobytes()
            assert seen.proprioception.tobytes() == of_own.proprioception.tobytes()
            assert together.proprioception().tobytes() == of_own.proprioception.tobytes()
            assert (mobile(built, together.qpos) == mobile(built, theirs.qpos)).all()
            assert limbs(built, together.qpos) == limbs(built, mine.qpos)
        if tied:  # it would show, were it the infant's own
            assert (mobile(built, together.qpos) != mobile(built, mine.qpos)).any(axis=1).all()
            assert limbs(built, together.qpos) != limbs(built, theirs.qpos)


def test_nothing_that_an_infant_does_moves_the_mobile(built: scene.Scene, donated: Actions) -> None:
    restless, still = yoked(built, 40.0, donated), yoked(built, 40.0, donated)
    nothing = np.zeros((2, 12), bool)
    for step in range(STEPS):
        (one,) = restless.parts(~nothing, ~nothing, step in TIED, 1)
        (other,) = still.parts(nothing, nothing, step in TIED, 1)
        assert one.path_length.tobytes() == other.path_length.tobytes()
        assert mobile(built, restless.qpos).tobytes() == mobile(built, still.qpos).tobytes()
        assert (one.proprioception != other.proprioception).any()


def test_what_is_seen_is_what_the_donor_saw_but_for_the_arms(built: scene.Scene, eye: Eye, donated: Actions) -> None:
    """Only arms and mobile can be seen: with the donor's arms, every picture is the donor's."""
    together, theirs, unlike = yoked(built, 40.0, donated), worlds(built, 40.0, 5, 6), []
    chosen = [name for name in body.JOINTS[body.FIXED :] if any(part in name for part in ARMS)]
    arms = [built.model.joint(name).qposadr[0] for name in chosen]
    for step, (moved, positive) in enumerate(own_actions()):
        tied = step in TIED
        pieces = together.parts(moved, positive, tied, 3), theirs.parts(donated[0][step], donated[1][step], tied, 3)
        for _ in zip(*pieces, strict=True):
            seen, wanted = together.qpos, eye.frames(theirs.qpos)
            unlike.append((eye.frames(seen) != wanted).any())
            seen[:, arms] = theirs.qpos[:, arms]
            assert (eye.frames(seen) == wanted).all()
            assert limbs(built, seen) != limbs(built, theirs.qpos)
    assert any(unlike)


def test_positions_are_a_copy(built: scene.Scene, donated: Actions) -> None:
    together = yoked(built, 0.0, donated)
    before = together.qpos
    together.qpos[:] = 7
    assert together.qpos.tobytes() == before.tobytes()


def test_there_must_be_a_donor_for_each(built: scene.Scene, donated: Actions) -> None:
    with pytest.raises(ValueError, match=r"^There must be a donor for each of 2 infants; there are 1\.$"):
        Yoked(worlds(built, 0.0, 0, 1), worlds(built, 0.0, 5), *donated)
    with pytest.raises(ValueError, match=r"^moved must be \(2, 12\)"):
        for _ in Yoked(worlds(built, 0.0, 0, 1), worlds(built, 0.0, 5, 6), *(part[:, :1] for part in donated)).parts(
            donated[0][0], donated[1][0], False, 1
        ):
            pass


def test_a_donors_run_ends(built: scene.Scene, donated: Actions) -> None:
    short = yoked(built, 0.0, (donated[0][:1], donated[1][:1]))
    for _ in short.parts(donated[0][0], donated[1][0], False, 1):
        pass
    with pytest.raises(IndexError):
        next(iter(short.parts(donated[0][0], donated[1][0], False, 1)))
