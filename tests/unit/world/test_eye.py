"""The eye: identical frames in every process, nothing visible left out, the rope invisible."""

import hashlib
import subprocess
import sys

import mujoco
import numpy as np
import pytest

from mimo.record import runtime
from mimo.settings import params
from mimo.world import scene
from mimo.world.eye import SIZE, Eye
from mimo.world.physics import Worlds

P = params.load()
SCRIPT = """
import hashlib
from tests.unit.world.test_eye import frames
print(hashlib.sha256(frames().tobytes()).hexdigest())
"""


def frames() -> np.ndarray:
    built = scene.build(P.world, P.protocol)
    w = Worlds(built, P.protocol, 40.0, [np.random.default_rng(seed) for seed in (0, 1)])
    pictures = []
    with Eye(built) as eye:
        for step in range(5):
            w.step(np.ones((2, 12), bool), np.full((2, 12), step % 2 == 0), attached=True)
            pictures.append(eye.frames(w.qpos))
    return np.stack(pictures)


def test_frames_are_the_same_bytes_in_another_process() -> None:
    here = hashlib.sha256(frames().tobytes()).hexdigest()
    there = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True).stdout.strip()
    assert there == here


def test_shape_type_and_a_mobile_in_the_picture() -> None:
    pictures = frames()
    assert pictures.shape == (5, 2, SIZE, SIZE, 3)
    assert pictures.dtype == np.uint8
    red, green, blue = (pictures[0, 0, ..., channel].astype(int) for channel in range(3))
    for one, other, third in ((red, green, blue), (green, red, blue), (blue, red, green)):
        assert ((one > other + 60) & (one > third + 40)).sum() > 50  # a toy of that colour


def test_a_frame_does_not_depend_on_the_frames_before() -> None:
    built = scene.build(P.world, P.protocol)
    rest, bent = built.model.key_qpos[0].copy(), built.model.key_qpos[0].copy()
    bent[built.model.joint("suspension").qposadr[0] :][:4] = (0.995, 0.07, 0.07, 0.0)
    with Eye(built) as eye:
        first = eye.frames(rest[None])[0]
        other, again = eye.frames(np.stack([bent, rest]))
    assert (first == again).all()
    assert (first != other).any()


@pytest.mark.parametrize("limb", ["left_foot", "right_hand"])
def test_nothing_the_eye_could_see_is_left_out(limb: str) -> None:
    """By segmentation of the whole scene over a lively random policy: what shows belongs to the drawn group."""
    protocol = P.protocol.model_copy(update={"limb": limb})
    built = scene.build(P.world, protocol)
    model, data, rng = built.model, mujoco.MjData(built.model), np.random.default_rng(5)
    w = Worlds(built, protocol, 40.0, [np.random.default_rng(seed) for seed in range(4)])
    everything = mujoco.MjvOption()
    everything.geomgroup[:] = 1
    seen: set[int] = set()
    with runtime.renderer(model, SIZE, SIZE) as renderer:
        renderer.enable_segmentation_rendering()
        for _ in range(60):
            w.step(rng.random((4, 12)) < 0.5, rng.random((4, 12)) < 0.5, attached=True)
            for qpos in w.qpos:
                data.qpos[:] = qpos
                mujoco.mj_forward(model, data)
                renderer.update_scene(data, "right_eye", everything)
                picture = renderer.render()
                seen |= set(picture[..., 0][picture[..., 1] == int(mujoco.mjtObj.mjOBJ_GEOM)].tolist())
    assert any(model.body(model.geom_bodyid[geom]).name == "mobile" for geom in seen)
    hidden = [model.body(model.geom_bodyid[geom]).name for geom in seen if model.geom_group[geom] != scene.SEEN]
    assert not hidden


def test_what_is_nearer_than_4_mm_is_cut() -> None:
    model = scene.build(P.world, P.protocol).model
    assert model.vis.map.znear * model.stat.extent == pytest.approx(0.004)


def test_the_rope_is_invisible() -> None:
    built = scene.build(P.world, P.protocol)
    with Eye(built) as eye:
        before = eye.frames(built.model.key_qpos[:1])
        built.model.tendon_stiffness[built.rope] = built.rope_stiffness
        built.model.tendon_width[built.rope] = 0.05
        assert (eye.frames(built.model.key_qpos[:1]) == before).all()
