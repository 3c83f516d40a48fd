"""Worlds in lock step: phases, rope, noise, path length, independence and divergence."""

import mujoco
import numpy as np
import pytest

from mimo.settings import params
from mimo.world import body, scene
from mimo.world.physics import DivergedError, Outcome, Tied, Worlds

P = params.load()


@pytest.fixture(scope="module")
def built() -> scene.Scene:
    return scene.build(P.world, P.protocol)


def worlds(built: scene.Scene, force: float, *seeds: int) -> Worlds:
    return Worlds(built, P.protocol, force, [np.random.default_rng(seed) for seed in seeds])


def kick(w: Worlds, *joints: str) -> tuple[np.ndarray, np.ndarray]:
    """Which joints move in every world, all in the positive direction."""
    moved = np.isin(body.ACTUATED, joints) & np.ones((w.size, 1), bool)
    return moved, np.ones((w.size, 12), bool)


def test_the_mobile_hangs_still_when_nothing_pulls(built: scene.Scene) -> None:
    w = worlds(built, 0.0, 0)
    for _ in range(3):
        outcome = w.step(*kick(w, *body.ACTUATED), attached=False)
    assert outcome.path_length[0] < 1e-9


@pytest.mark.parametrize("limb", body.LIMB_JOINTS)
def test_the_rope_of_each_limb_moves_the_mobile(limb: str) -> None:
    built = scene.build(P.world, P.protocol.model_copy(update={"limb": limb}))
    w = worlds(built, 0.0, 0)
    own = w.step(*kick(w, *body.LIMB_JOINTS[limb]), attached=True)
    assert own.path_length[0] > 0.005
    others = [joint for joint in body.ACTUATED if joint.split("_")[1].startswith("sho") != limb.endswith("hand")]
    w = worlds(built, 0.0, 0)
    assert w.step(*kick(w, *others), attached=True).path_length[0] < own.path_length[0] / 5


def test_attaching_alone_moves_nothing(built: scene.Scene) -> None:
    """The rope is taut at rest, without tension."""
    w = worlds(built, 0.0, 0)
    assert w.step(*kick(w), attached=True).path_length[0] < 1e-4


def test_detaching_lets_the_mobile_return(built: scene.Scene) -> None:
    w = worlds(built, 0.0, 0)
    start = w.centre_of_mass
    pulled = w.step(*kick(w, "left_hip2", "left_knee"), attached=True).centre_of_mass
    for _ in range(5):
        back = w.step(*kick(w), attached=False).centre_of_mass
    assert np.linalg.norm(back - start) < 0.2 * np.linalg.norm(pulled - start)


def test_noise_is_40_newton_in_a_fresh_direction_at_every_update(built: scene.Scene) -> None:
    w = worlds(built, 40.0, 5)
    control = w._control(*kick(w))
    forces = control[0, :, 12:].reshape(120, -1, 6)[:, built.mobile, :3]
    assert np.linalg.norm(forces, axis=1) == pytest.approx(np.full(120, 40.0))
    others = np.delete(control[0, :, 12:].reshape(120, -1, 6), built.mobile, axis=1)
    assert not others.any()
    direction = forces / 40
    assert np.abs((direction[1:] * direction[:-1]).sum(axis=1).mean()) < 0.2
    many = np.concatenate([w._control(*kick(w))[0, :, 12:].reshape(120, -1, 6)[:, built.mobile, :3] / 40
                           for _ in range(50)])  # fmt: skip
    assert np.abs(many.mean(axis=0)).max() < 0.03
    assert np.square(many).mean(axis=0) == pytest.approx(np.full(3, 1 / 3), abs=0.03)


@pytest.mark.parametrize(("positive", "torque"), [(True, 10.0), (False, -6.5)])
def test_full_torque_acts_for_40_updates_then_rests(positive: bool, torque: float, built: scene.Scene) -> None:
    w = worlds(built, 0.0, 0)
    moved, _ = kick(w, "left_knee")
    control = w._control(moved, np.full((1, 12), positive))[0]
    assert (control[:40, moved[0]] == torque).all()
    assert not control[:, ~moved[0]].any()
    assert not control[40:].any()
    assert control.shape == (120, 12)


def test_path_length_and_centre_against_a_plain_loop(built: scene.Scene) -> None:
    """The same agent step by mj_step, one update at a time."""
    w = worlds(built, 40.0, 2)
    control = w._control(*kick(w, "left_hip1", "left_knee"))
    model = built.model
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    stiffness = model.tendon_stiffness.copy()
    model.tendon_stiffness[built.rope] = built.rope_stiffness
    try:
        last, length = data.subtree_com[built.mobile].copy(), 0.0
        after = mujoco.MjData(model)
        for row in control[0]:
            data.ctrl[:] = row[:12]
            data.xfrc_applied[:] = row[12:].reshape(-1, 6)
            mujoco.mj_step(model, data)
            after.qpos[:] = data.qpos  # mj_step leaves the centres of mass of the positions that it began with
            mujoco.mj_kinematics(model, after)
            mujoco.mj_comPos(model, after)
            length += float(np.linalg.norm(after.subtree_com[built.mobile] - last))
            last = after.subtree_com[built.mobile].copy()
    finally:
        model.tendon_stiffness[:] = stiffness
    outcome = w._advance(control, attached=True)
    assert outcome.path_length[0] == pytest.approx(length, rel=1e-12)
    assert np.linalg.norm(data.subtree_com[built.mobile] - last) > 1e-4
    assert outcome.centre_of_mass[0] == pytest.approx(last, abs=1e-12)
    assert w.qpos[0] == pytest.approx(data.qpos, abs=1e-12)


@pytest.mark.parametrize(("count", "ends"), [(1, [120]), (4, [30, 60, 90, 120]), (7, [17, 34, 51, 68, 85, 102, 120])])
def test_the_parts_of_a_step_are_as_even_as_updates_are(
    count: int, ends: list[int], built: scene.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    updates: list[int] = []
    advance = Worlds._advance

    def spy(self: Worlds, control: np.ndarray, attached: Tied) -> Outcome:
        updates.append(control.shape[1])
        return advance(self, control, attached)

    monkeypatch.setattr(Worlds, "_advance", spy)
    one = worlds(built, 40.0, 1)
    *_, last = one.parts(*kick(one, "left_knee"), attached=True, count=count)
    assert np.cumsum(updates).tolist() == ends
    two = worlds(built, 40.0, 1)
    whole = two.step(*kick(two, "left_knee"), attached=True)
    assert last.centre_of_mass.tobytes() == whole.centre_of_mass.tobytes()


def test_the_pieces_of_a_step_are_the_step(built: scene.Scene) -> None:
    """Cut within the torque and after it; each piece says where the worlds are when it ends."""
    one, two = worlds(built, 40.0, 1), worlds(built, 40.0, 1)
    for _ in range(2):
        whole = one.step(*kick(one, "left_knee"), attached=True)
        parts, between = [], []
        for part in two.pieces(*kick(two, "left_knee"), attached=True, cuts=[7, 112]):
            assert part.centre_of_mass.tobytes() == two.centre_of_mass.tobytes()
            assert part.proprioception.tobytes() == two.proprioception().tobytes()
            parts.append(part)
            between.append(two.qpos.tobytes())
        assert len(set(between)) == 3
        assert between[-1] == one.qpos.tobytes()
        assert parts[-1].centre_of_mass.tobytes() == whole.centre_of_mass.tobytes()
        assert sum(part.path_length[0] for part in parts) == pytest.approx(whole.path_length[0], rel=1e-12)


def test_a_world_is_the_same_bytes_in_any_company(built: scene.Scene) -> None:
    many, alone = worlds(built, 40.0, 0, 1, 2, 3), worlds(built, 40.0, 2)
    for step in range(6):
        joints = [name for i, name in enumerate(body.ACTUATED) if (i + step) % 3 == 0]
        together = many.step(*kick(many, *joints), attached=step > 2)
        apart = alone.step(*kick(alone, *joints), attached=step > 2)
        assert together.proprioception[2].tobytes() == apart.proprioception[0].tobytes()
        assert together.path_length[2] == apart.path_length[0]
        assert together.centre_of_mass[2].tobytes() == apart.centre_of_mass[0].tobytes()


def test_the_rope_is_on_where_it_is_said_to_be(built: scene.Scene) -> None:
    """An array says of each world what a bool says of all."""
    ropes = np.array([[True, False, True, False], [False, False, True, True], [False, True, False, False]])
    many, alone = worlds(built, 40.0, 0, 1, 2, 3), [worlds(built, 40.0, seed) for seed in range(4)]
    twin = worlds(built, 40.0, 0, 1, 2, 3)
    for attached in ropes:
        together = many.step(*kick(many, "left_hip2", "left_knee"), attached=attached)
        *_, cut = twin.parts(*kick(twin, "left_hip2", "left_knee"), attached=attached, count=4)
        assert cut.centre_of_mass.tobytes() == together.centre_of_mass.tobytes()
        for place, one in enumerate(alone):
            apart = one.step(*kick(one, "left_hip2", "left_knee"), attached=bool(attached[place]))
            assert together.proprioception[place].tobytes() == apart.proprioception[0].tobytes()
            assert together.path_length[place] == apart.path_length[0]
            assert together.centre_of_mass[place].tobytes() == apart.centre_of_mass[0].tobytes()
    for attached in (True, False):
        one, two = worlds(built, 40.0, 1, 2), worlds(built, 40.0, 1, 2)
        given = [w.step(*kick(w, "left_knee"), attached=a) for w, a in ((one, attached), (two, np.full(2, attached)))]
        assert given[0].centre_of_mass.tobytes() == given[1].centre_of_mass.tobytes()


def test_a_diverging_world_raises_with_its_number(built: scene.Scene) -> None:
    w = worlds(built, 0.0, 0, 1, 2)
    w._batch.bind("qvel")[1, 3] = 1e12
    with pytest.raises(DivergedError, match="world 1 of 3"):
        w.step(*kick(w), attached=False)


def test_proprioception_is_47_angles_with_the_fixed_ones_zero(built: scene.Scene) -> None:
    w = worlds(built, 0.0, 0)
    angles = w.step(*kick(w, "left_knee"), attached=False).proprioception
    assert angles.shape == (1, 47)
    assert not angles[:, : body.FIXED].any()
    data = w._batch.get_data(0)
    for name in body.JOINTS[body.FIXED :]:
        assert angles[0, body.JOINTS.index(name)] == data.joint(name).qpos[0]
