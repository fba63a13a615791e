"""Keyframes against closed forms; the pose of a camera that looks at a point."""

import numpy as np
import pytest

from raytrace_ii.scene.keyframes import Track, looking_pose


def test_straight_lines_between_keyframes_and_the_ends_beyond_them():
    track = Track([2, 4, 8], [[0.0], [10.0], [-2.0]])
    for frame, value in ((0, 0), (2, 0), (3, 5), (4, 10), (5, 7), (8, -2), (99, -2)):
        assert track.at(frame) == pytest.approx(value)


def test_two_smooth_keyframes_are_smoothstep():
    track = Track([0, 10], [[0.0], [1.0]], "smooth")
    for frame in np.linspace(0, 10, 11):
        s = frame / 10
        assert track.at(frame)[0] == pytest.approx(3 * s**2 - 2 * s**3, abs=1e-12)


def test_a_smooth_track_has_no_kink_at_a_keyframe():
    track = Track([0, 3, 10], [[0.0], [5.0], [6.0]], "smooth")
    before, after = track.at(3) - track.at(3 - 1e-6), track.at(3 + 1e-6) - track.at(3)
    np.testing.assert_allclose(before / 1e-6, 6 / 10, rtol=1e-4)  # the slope between its neighbours
    np.testing.assert_allclose(after / 1e-6, 6 / 10, rtol=1e-4)


def test_steps_hold_until_the_next_keyframe():
    track = Track([0, 5], [[1.0, 2.0], [3.0, 4.0]], "step")
    assert track.at(4.999).tolist() == [1, 2] and track.at(5).tolist() == [3, 4]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (([0, 0], [[1], [2]]), "growing"),
        (([], []), "at least one"),
        (([0, 1], [[1]]), "a value for each"),
        (([0, 1], [[1], [1, 2]]), "all of one length"),
        (([0], [[1]], "cubic"), "linear, smooth, step"),
    ],
)
def test_invalid_tracks_are_refused(arguments, named):
    with pytest.raises(ValueError, match=named):
        Track(*arguments)


def test_a_camera_that_looks_ahead_is_only_moved():
    pose = looking_pose((1, 2, 3), (1, 2, 50))
    np.testing.assert_allclose(pose, [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])


def test_a_looking_camera_is_rigid_level_and_sees_the_point_ahead():
    pose = looking_pose((5, -4, 10), (-20, 9, 90))
    turn = pose[:3, :3]
    np.testing.assert_allclose(turn.T @ turn, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1)
    assert turn[1, 0] == pytest.approx(0) and turn[1, 1] > 0
    seen = turn.T @ (np.array([-20, 9, 90]) - pose[:3, 3])
    np.testing.assert_allclose(seen[:2], 0, atol=1e-12)
    assert seen[2] > 0


def test_roll_turns_x_towards_y():
    pose = looking_pose((0, 0, 0), (0, 0, 1), 90)
    np.testing.assert_allclose(pose[:3, 0], [0, 1, 0], atol=1e-12)


def test_a_camera_cannot_look_straight_up():
    with pytest.raises(ValueError, match="straight above"):
        looking_pose((0, 0, 0), (0, 5, 0))
