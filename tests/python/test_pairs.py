import timeit

import numpy as np
import pytest

import cairn
import scene

SCENE = scene.Scene(num_images=4, num_points=400, seed=3)


def arguments(num_wrong=120, frames=True, depths=True, dtype=float):
    """Of verify_pair for images 1 and 3, whose pose is SCENE.relative(1, 3), and which matches are right."""
    matches, is_right = SCENE.matches(1, 3, num_wrong)
    given = {"camera1": SCENE.camera, "camera2": SCENE.camera}
    for number, image in (("1", 1), ("2", 3)):
        pixels, shapes, depth = SCENE.observe(image)
        rows = matches[:, int(number) - 1]
        given["points" + number] = pixels[rows].astype(dtype)
        if frames:
            given["frames" + number] = shapes[rows]
        if depths:
            given["depths" + number] = depth[rows]
    return given, is_right


@pytest.mark.parametrize("frames,depths,verifier", [(True, True, "one_ac_depth"), (True, False, "two_ac"),
                                                    (False, True, "triangles"), (False, False, "five_point")])
def test_finds_the_pose_whatever_is_known(frames, depths, verifier):
    given, is_right = arguments(frames=frames, depths=depths)
    report = cairn.verify_pair(**given)
    assert report.status == "verified" and report.geometry.config == "calibrated"
    assert report.verifier == verifier
    assert scene.pose_error_deg(report.cam2_from_cam1, SCENE.relative(1, 3)) < 0.01
    found = np.isin(np.arange(len(is_right)), report.inliers)
    assert found[is_right].all() and found[~is_right].mean() < 0.1
    assert report.num_inliers == len(report.inliers) == len(report.geometry.inlier_matches)
    x1, x2 = (np.column_stack([given["points" + k], np.ones(len(is_right))]) for k in "12")
    assert np.abs(np.einsum("ni,ij,nj->n", x2, report.geometry.F, x1))[is_right].max() < 1e-3


def test_matches_name_rows_of_keypoints():
    matches, _ = SCENE.matches(1, 3, 120)
    keypoints = {"camera1": SCENE.camera, "camera2": SCENE.camera}
    for number, image in (("1", 1), ("2", 3)):
        for name, values in zip(("points", "frames", "depths"), SCENE.observe(image)):
            keypoints[name + number] = values
    report, of_rows = cairn.verify_pair(**keypoints, matches=matches), cairn.verify_pair(**arguments()[0])
    np.testing.assert_array_equal(report.cam2_from_cam1.matrix(), of_rows.cam2_from_cam1.matrix())
    np.testing.assert_array_equal(report.inliers, of_rows.inliers)
    np.testing.assert_array_equal(report.geometry.inlier_matches, matches[report.inliers])
    with pytest.raises(cairn.ConfigError, match="matches: there is no row 400 of points1, which has 400"):
        cairn.verify_pair(**keypoints, matches=[[400, 0]])
    with pytest.raises(cairn.ConfigError, match="depths1: "):
        cairn.verify_pair(**{**keypoints, "depths1": keypoints["depths1"][:7]}, matches=matches)
    assert cairn.verify_pair(**keypoints, matches=np.zeros((0, 2), int)).status == "too_few_matches"


def test_arrays_of_any_kind_are_taken():
    given, _ = arguments(frames=False)
    poses = []
    wide = np.zeros((len(given["points1"]), 5))
    wide[:, 1:3] = given["points1"]
    odd = np.zeros(2 * len(given["points1"]) + 1)[1:].reshape(-1, 2)  # not aligned as Eigen needs it
    odd[:] = given["points1"]
    points = given["points1"]
    for points1 in (points, wide[:, 1:3], odd, points.tolist(), np.asfortranarray(points)):
        poses.append(cairn.verify_pair(**{**given, "points1": points1}).cam2_from_cam1.matrix())
    for pose in poses[1:]:
        np.testing.assert_array_equal(pose, poses[0])


def test_missing_depths_are_not_numbers():
    given, _ = arguments(frames=False)
    given["depths1"][::2] = np.nan
    report = cairn.verify_pair(**given)
    assert report.verifier == "triangles" and report.cam2_from_cam1


def test_says_why_there_is_no_pose_and_what_is_wrong():
    given, _ = arguments(num_wrong=400, frames=False, depths=False)
    assert cairn.verify_pair(**given).status == "too_few_inliers"
    assert cairn.verify_pair(**given).cam2_from_cam1 is None
    assert cairn.verify_pair(**given, options={"min_num_matches": 500}).status == "too_few_matches"
    with pytest.raises(cairn.ConfigError, match="points2: 399 are given, but 400 points in the first image"):
        cairn.verify_pair(**{**given, "points2": given["points2"][1:]})
    with pytest.raises(cairn.ConfigError, match="verifier: .*six_point.*cascade"):
        cairn.verify_pair(**given, verifier="six_point")
    with pytest.raises(cairn.ConfigError, match="options: unknown key 'min_num_inlier'; did you mean"):
        cairn.verify_pair(**given, options={"min_num_inlier": 3})
    with pytest.raises(cairn.ConfigError, match="confidence: 'high' is not a number"):
        cairn.verify_pair(**given, options={"confidence": "high"})
    with pytest.raises(cairn.ConfigError, match="verification.confidence"):
        cairn.verify_pair(**given, options={"confidence": 2.0})


def test_the_seed_decides():
    given, _ = arguments(num_wrong=300, frames=False, depths=False)
    runs = {cairn.verify_pair(**given, seed=seed).num_iterations for seed in range(5)}
    assert len(runs) > 1
    assert cairn.verify_pair(**given).num_iterations == cairn.verify_pair(**given).num_iterations


def test_a_call_costs_less_than_50_microseconds():
    """All that is not the verification itself: a pair that is not tried."""
    given, _ = arguments()
    options = {"min_num_matches": 401}
    assert cairn.verify_pair(**given, options=options).status == "too_few_matches"
    times = timeit.repeat(lambda: cairn.verify_pair(**given, options=options), number=1, repeat=2000)
    print(f"{1e6 * min(times):.1f} microseconds")
    assert min(times) < 50e-6


def test_the_columns_of_frames_are_axes():
    """Rows in their place are wrong frames, with which more hypotheses are needed."""
    given, _ = arguments(depths=False, num_wrong=300)
    swapped = {**given, **{key: given[key].transpose(0, 2, 1) for key in ("frames1", "frames2")}}
    assert 2 * cairn.verify_pair(**given).num_iterations < cairn.verify_pair(**swapped).num_iterations
