import numpy as np
import pytest

import cairn
import scene


def edges_of(truth, wrong=()):
    """Exact edges of all pairs; those in `wrong` have a rotation that has nothing to do with the truth."""
    rng = np.random.default_rng(5)
    poses = [truth.relative(i, j) for i, j in truth.pairs]
    rotations = np.array([p.rotation.matrix() for p in poses])
    for k in wrong:
        rotations[k] = scene.random_rotation(rng)
    translations = np.array([p.translation / np.linalg.norm(p.translation) for p in poses])
    return truth.pairs, rotations, translations, np.full(len(poses), 100)


def test_wrong_edges_are_taken_out_with_the_reason():
    truth = scene.Scene(num_images=8)
    wrong = [3, 11]
    pairs, rotations, translations, num_inliers = edges_of(truth, wrong)
    num_inliers[20] = 5
    graph = cairn.ViewGraph.from_edges(pairs, rotations, translations, num_inliers)
    reasons = np.array(graph.reasons)
    assert set(reasons[wrong]) == {"triplet_inconsistent"} and reasons[20] == "too_few_inliers"
    np.testing.assert_array_equal(np.flatnonzero(~graph.is_active), sorted([*wrong, 20]))
    np.testing.assert_array_equal(graph.pairs, pairs)
    np.testing.assert_allclose(graph.rotations, rotations, atol=1e-12)
    np.testing.assert_allclose(graph.translations, translations, atol=1e-12)
    np.testing.assert_array_equal(graph.image_ids, truth.image_ids)
    assert len(graph) == 28 and graph.components() == [list(truth.image_ids)]
    loose = cairn.ViewGraph.from_edges(pairs, rotations, translations, num_inliers, options={"min_num_inliers": 0})
    assert loose.is_active[20]


def test_images_may_be_named_in_any_order():
    truth = scene.Scene(num_images=4)
    pairs, rotations, translations, num_inliers = edges_of(truth)
    swapped = cairn.ViewGraph.from_edges(pairs[:, ::-1], np.transpose(rotations, (0, 2, 1)),
                                         -np.einsum("nji,nj->ni", rotations, translations), num_inliers)
    np.testing.assert_array_equal(swapped.pairs, pairs)
    np.testing.assert_allclose(swapped.rotations, rotations, atol=1e-12)
    np.testing.assert_allclose(swapped.translations, translations, atol=1e-12)


def test_wrong_arrays_are_named():
    pairs, rotations, translations, num_inliers = edges_of(scene.Scene(num_images=4))
    with pytest.raises(cairn.ConfigError, match=r"translations: its shape is \(5, 3\), not \(6, 3\)"):
        cairn.ViewGraph.from_edges(pairs, rotations, translations[1:], num_inliers)
    with pytest.raises(cairn.ConfigError, match="pairs: 2 and 3 are there twice"):
        twice = pairs.copy()
        twice[1] = twice[3][::-1]
        cairn.ViewGraph.from_edges(twice, rotations, translations, num_inliers)
    with pytest.raises(cairn.ConfigError, match="num_inliers: 2147483648 is not from 0 to 2147483647"):
        cairn.ViewGraph.from_edges(pairs, rotations, translations, [2**31] * len(pairs))
    with pytest.raises(cairn.ConfigError, match="pairs: 2147483647 is not from 0 to 2147483646"):
        cairn.ViewGraph.from_edges([[1, 2**31 - 1]], rotations[:1], translations[:1], [30])
    with pytest.raises(cairn.ConfigError, match=r"pairs\[2\]: an edge from an image to itself"):
        pairs[2] = [3, 3]
        cairn.ViewGraph.from_edges(pairs, rotations, translations, num_inliers)
    with pytest.raises(cairn.ConfigError, match=r"rotations\[1\]: not a rotation"):
        cairn.average_rotations([[1, 2], [2, 3]], [np.eye(3), 2 * np.eye(3)])
