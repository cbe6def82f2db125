#!/usr/bin/env python3
"""Which pairs were taken out of a view graph, and why, as a picture: usage removed_edges.py DATABASE PICTURE.png"""
import collections
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

import cairn  # noqa: E402


def main(database_path, picture_path):
    graph = cairn.ViewGraph.from_database(database_path)
    reasons = np.array(graph.reasons)
    place = {image_id: k for k, image_id in enumerate(graph.image_ids)}
    rows, columns = (np.array([place[i] for i in side]) for side in graph.pairs.T)
    figure, (matrix, histogram) = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
    for reason, count in collections.Counter(graph.reasons).most_common():
        print(f"{reason}: {count}")
        chosen = reasons == reason
        color = "lightgray" if reason == "in_use" else None
        points = matrix.scatter(columns[chosen], rows[chosen], s=12, marker="s", color=color,
                                label=f"{reason} ({count})")
        histogram.hist(graph.num_inliers[chosen], bins=30, histtype="step", color=points.get_facecolor()[0])
    matrix.set(title="pairs", xlabel="second image", ylabel="first image", aspect="equal")
    matrix.legend(fontsize="small", loc="lower left")
    histogram.set(title="inliers of a pair", xlabel="inliers", ylabel="pairs", yscale="log")
    figure.savefig(picture_path, dpi=120)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
