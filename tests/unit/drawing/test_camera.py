"""The camera of films and figure 1: the limb in its colour, the rope while it is tied, the still on white."""

from contextlib import closing

import mujoco
import numpy as np
import pytest

from mimo.settings import params
from mimo.settings.params import Params
from mimo.world import body, scene
from mimo.world.eye import Eye
from mimo.world.scene import ARMS, Scene
from stages.drawing import camera
from stages.drawing.camera import FROM_THE_FEET, FROM_THE_LEFT, LEGS, Camera, Place

SIZE = (100, 100)
MAGENTA = "#FF00FF"  # nothing else in the scene is


def built(p: Params, limb: str) -> Scene:
    return scene.build(p.world, params.checked(p.protocol, {"limb": limb}))


def in_colour(made: Scene, limb: str) -> tuple[np.ndarray, np.ndarray]:
    """Which pixels are magenta, and which body is seen in each (SIZE, -1 where none is)."""
    with closing(Camera(made, limb, MAGENTA, SIZE, FROM_THE_FEET)) as drawn:
        red, green, blue = np.moveaxis(drawn.picture(made.model.key_qpos[0], attached=False).astype(int), -1, 0)
        drawn._renderer.enable_segmentation_rendering()
        number, kind = np.moveaxis(drawn.picture(made.model.key_qpos[0], attached=False), -1, 0)
    seen = np.where(kind == mujoco.mjtObj.mjOBJ_GEOM, made.model.geom_bodyid[number], -1)
    return np.minimum(red, blue) - green > 60, seen


@pytest.mark.parametrize("limb", body.LIMB_JOINTS)
def test_the_limb_and_nothing_else_has_the_colour(limb: str, tiny: Params) -> None:
    made = built(tiny, limb)
    before = made.model.geom_rgba.copy()
    coloured, seen = in_colour(made, limb)
    side, end = limb.split("_")
    parts = [made.model.body(f"{side}_{part}").id for part in (ARMS if end == "hand" else LEGS)]
    assert coloured.sum() > 50
    assert np.array_equal(coloured, np.isin(seen, parts))
    assert np.array_equal(made.model.geom_rgba, before)


def test_a_right_limb_is_seen_from_the_right(tiny: Params) -> None:
    left, right = (in_colour(built(tiny, f"{side}_foot"), f"{side}_foot")[0] for side in ("left", "right"))
    assert (left != right[:, ::-1]).sum() < 0.05 * left.sum()


@pytest.mark.parametrize("place", [FROM_THE_LEFT, FROM_THE_FEET], ids=["from the left", "from the feet"])
def test_the_rope_is_drawn_while_it_is_tied(place: Place, tiny: Params) -> None:
    made = built(tiny, "left_foot")
    with closing(Camera(made, "left_foot", "#009E73", SIZE, place)) as drawn:
        tied, loose = (drawn.picture(made.model.key_qpos[0], attached).astype(int) for attached in (True, False))
    changed = tied[(tied != loose).any(axis=-1)]
    assert 20 < len(changed) < 0.05 * tied[..., 0].size
    assert (changed[:, 0] - changed[:, 1:].max(axis=1) > 20).mean() > 0.5, "not red"


def test_the_eye_does_not_see_the_rope(tiny: Params) -> None:
    seen = []
    for limb in ("left_foot", "right_foot"):
        made = built(tiny, limb)
        with Eye(made) as eye:
            seen.append(eye.frames(made.model.key_qpos))
    assert np.array_equal(seen[0], seen[1])


def test_the_still_is_on_white_with_no_trace_of_black(tiny: Params, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera, "STILL", 80)
    picture = camera.still(built(tiny, "left_foot"), "left_foot", "#009E73")
    assert picture.shape == (80, 80, 3)
    assert picture.dtype == np.uint8
    corners = picture[[0, 0, -1], [0, -1, -1]]
    assert (corners == 255).all()
    assert 0.3 < (picture == 255).all(axis=2).mean() < 0.8
    assert picture.max(axis=2).min() > 40
