"""Model text, random poses, and the comparison with MuJoCo's own kinematics."""

from __future__ import annotations

import mujoco
import numpy as np

from trajopt.models.coordinates import to_qpos


def wrap(body, extra=""):
    return (
        '<mujoco model="test"><compiler angle="radian"/>'
        f"{extra}<worldbody>{body}</worldbody></mujoco>"
    )


def random_configurations(model, count=5, seed=0):
    return np.random.default_rng(seed).uniform(-1.3, 1.3, (count, model.ndof))


def assert_same_kinematics(model, reference, seed=0):
    """Body frames, centre of mass and mass agree with a MuJoCo model of the same dofs."""
    assert model.ndof == reference.nv
    moving = reference.body_weldid != 0
    np.testing.assert_allclose(model.mass, reference.body_mass[moving].sum(), rtol=1e-12)
    data = mujoco.MjData(reference)
    for x in random_configurations(model, seed=seed):
        data.qpos[:] = to_qpos(reference, x)
        mujoco.mj_kinematics(reference, data)
        mujoco.mj_comPos(reference, data)
        frames = model.transforms(x)
        for k, name in enumerate(model.body_names):
            body = data.body(name)
            np.testing.assert_allclose(frames[k, :, :3], body.xmat.reshape(3, 3), atol=1e-12)
            np.testing.assert_allclose(frames[k, :, 3], body.xpos, atol=1e-12)
        weights = reference.body_mass[moving]
        center = weights @ data.xipos[moving] / weights.sum()
        np.testing.assert_allclose(model.center_of_mass(x), center, atol=1e-12)
