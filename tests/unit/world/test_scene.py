"""The crib: a mattress without end, and rails that are only looked at."""

import mujoco
import numpy as np

from mimo.settings import params
from mimo.world import scene
from mimo.world.physics import Worlds

P = params.load()


def test_the_mattress_is_a_plane_and_the_only_solid_thing_of_the_crib() -> None:
    model = scene.build(P.world, P.protocol).model
    solid = [model.geom(geom) for geom in range(model.ngeom) if model.geom_contype[geom] | model.geom_conaffinity[geom]]
    crib = [geom for geom in solid if geom.bodyid[0] == 0]
    assert [geom.name for geom in crib] == ["mattress"]
    assert crib[0].type[0] == mujoco.mjtGeom.mjGEOM_PLANE
    assert not crib[0].pos.any()


def test_no_limb_comes_as_far_as_the_rails() -> None:
    """Over a lively random policy: every limb stays clear of the rails, which let everything through."""
    built = scene.build(P.world, P.protocol)
    model, data, rng = built.model, mujoco.MjData(built.model), np.random.default_rng(1)
    rails = [g for g in range(model.ngeom) if model.geom_bodyid[g] == 0 and abs(model.geom_pos[g][1]) > 0.1]
    inner = min(abs(model.geom_pos[g][1]) - model.geom_size[g][1] for g in rails)
    limbs = [g for g in range(model.ngeom) if model.geom_contype[g] and model.geom_bodyid[g]]
    worlds = Worlds(built, P.protocol, 0.0, [np.random.default_rng(seed) for seed in range(8)])
    farthest = 0.0
    for _ in range(100):
        worlds.step(rng.random((8, 12)) < 0.5, rng.random((8, 12)) < 0.5, attached=False)
        for qpos in worlds.qpos:
            data.qpos[:] = qpos
            mujoco.mj_kinematics(model, data)
            reach = np.abs(data.geom_xpos[limbs, 1]) + model.geom_rbound[limbs]
            farthest = max(farthest, float(reach.max()))
    assert farthest < inner
