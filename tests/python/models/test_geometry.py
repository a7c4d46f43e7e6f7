"""Contact points and the spheres of self collision."""

import numpy as np
import pytest

from trajopt import ModelWarning

FREE = '<body name="a" pos="0 0 5"><freejoint/>{}</body>'


def points(model):
    """World positions in the pose of the file, and radii."""
    return model.contact_positions(model.home), model.point_radius


@pytest.mark.parametrize(
    ("geom", "count", "radius"),
    [
        ('<geom size=".2"/>', 1, 0.2),
        ('<geom type="capsule" size=".1 .5"/>', 2, 0.1),
        ('<geom type="box" size="1 2 3"/>', 8, 0),
        ('<geom type="cylinder" size="1 2"/>', 16, 0),
        ('<geom type="ellipsoid" size="1 2 3"/>', 6, 0),
    ],
)
def test_number_of_points_and_radius(mjcf, geom, count, radius):
    model = mjcf(FREE.format(geom))
    assert model.npoints == count
    assert (model.point_radius == radius).all()
    assert (model.point_body == 0).all()


def test_points_stand_where_the_geom_stands(mjcf):
    geom = '<geom type="capsule" size=".1" fromto="1 0 0 1 2 0"/>'
    centres, _ = points(mjcf(FREE.format(geom)))
    np.testing.assert_allclose(
        centres[np.argsort(centres[:, 1])], [[1, 0, 5], [1, 2, 5]], atol=1e-9
    )


def test_points_lie_on_the_surface_of_round_shapes(mjcf):
    centres, _ = points(mjcf(FREE.format('<geom type="ellipsoid" size="1 2 3" euler=".3 .1 .2"/>')))
    distance = np.sort(np.linalg.norm(centres - [0, 0, 5], axis=1))
    np.testing.assert_allclose(distance, [1, 1, 2, 2, 3, 3])


def test_mesh_points_are_the_hull(mjcf):
    vertices = "0 0 0  1 0 0  0 1 0  0 0 1  .1 .1 .1"  # the last one lies inside
    model = mjcf(
        FREE.format('<geom type="mesh" mesh="m"/>'),
        f'<asset><mesh name="m" vertex="{vertices}" scale="2 2 2"/></asset>',
    )
    found = {tuple(p) for p in (points(model)[0] - [0, 0, 5]).round(6) + 0.0}
    assert found == {(0, 0, 0), (2, 0, 0), (0, 2, 0), (0, 0, 2)}


def test_large_hulls_are_thinned_evenly(mjcf):
    directions = np.random.default_rng(0).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    text = " ".join(f"{v:.6f}" for v in directions.ravel())
    model = mjcf(
        FREE.format('<geom type="mesh" mesh="m"/>'),
        f'<asset><mesh name="m" vertex="{text}"/></asset>',
    )
    kept = points(model)[0] - [0, 0, 5]
    assert 25 < len(kept) <= 32
    # Nowhere does the thinned hull lie more than 20 % of the radius inside the full one.
    assert (directions @ kept.T).max(axis=1).min() > 0.8


def test_visual_geoms_touch_nothing(mjcf):
    visual = '<geom size="1" contype="0" conaffinity="0"/>'
    with pytest.warns(ModelWarning, match="no collision geometry"):
        assert mjcf(FREE.format(visual)).npoints == 0


def test_masks_decide_what_touches_the_plane(mjcf):
    plane = '<geom type="plane" size="1 1 1" contype="1" conaffinity="1"/>'
    limb = '<geom size=".3" contype="2" conaffinity="2"/>'
    foot = '<geom size=".1" contype="3" conaffinity="3"/>'
    assert mjcf(plane + FREE.format(limb + foot)).point_radius.tolist() == [0.1]


def test_a_pair_makes_contact_despite_the_masks(mjcf):
    plane = '<geom name="floor" type="plane" size="1 1 1" contype="0" conaffinity="0"/>'
    foot = '<geom name="foot" size=".1" contype="0" conaffinity="0"/>'
    pair = '<contact><pair geom1="floor" geom2="foot"/></contact>'
    assert mjcf(plane + FREE.format(foot), pair).npoints == 1


def test_ground_plane_is_reported(mjcf):
    plane = '<geom type="plane" size="1 1 1" pos="0 0 .3" euler=".1 0 0"/>'
    model = mjcf(plane + FREE.format('<geom size=".2"/>'))
    *normal, offset = model.ground
    np.testing.assert_allclose(normal, [0, -np.sin(0.1), np.cos(0.1)])
    assert offset == pytest.approx(0.3 * np.cos(0.1))
    assert any("ground plane" in note for note in model.notes)


CHAIN = (
    '<body name="a" pos="0 0 5"><freejoint/><geom name="ga" size=".1"/>'
    '<body name="b" pos="1 0 0"><joint/><geom name="gb" size=".1"/>'
    '<body name="c" pos="1 0 0"><joint/><geom name="gc" size=".1"/>'
    '<body name="d" pos="1 0 0"><joint/><geom name="gd" size=".1" {}/>'
    "</body></body></body></body>"
)


def collisions(model):
    return {
        tuple(sorted(model.body_names[model.sphere_body[i]] for i in pair))
        for pair in model.sphere_pairs
    }


def test_pairs_leave_out_neighbours(mjcf):
    assert collisions(mjcf(CHAIN.format(""))) == {("a", "c"), ("a", "d"), ("b", "d")}


def test_pairs_respect_exclude_masks_and_overlap(mjcf):
    exclude = '<contact><exclude body1="a" body2="c"/></contact>'
    assert collisions(mjcf(CHAIN.format(""), exclude)) == {("a", "d"), ("b", "d")}
    masked = CHAIN.format('contype="0" conaffinity="0"')
    assert collisions(mjcf(masked)) == {("a", "c")}
    overlapping = CHAIN.format('pos="-3 0 0"')  # d stands inside a
    assert collisions(mjcf(overlapping)) == {("a", "c"), ("b", "d")}


def test_spheres_fill_a_capsule(mjcf):
    other = '<body pos="5 0 0"><joint/><body><joint/><geom size=".1"/></body></body>'
    model = mjcf(FREE.format('<geom type="capsule" size=".1 .2"/>' + other))
    centres = model.sphere_centers(model.home)[:3]
    np.testing.assert_allclose(np.sort(centres[:, 2]), [4.8, 5, 5.2])
    assert (model.sphere_radius[:3] == 0.1).all()
