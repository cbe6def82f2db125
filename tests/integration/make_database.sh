#!/usr/bin/env bash
# usage: make_database.sh BUILD_VIEW_GRAPH SCENE: the scene's database, complete, for tests to copy.
set -eu
rm -f "$2"/scene.db*
"$1" --image_path "$2/images" --depth_path "$2/depth" --database_path "$2/scene.db" --features.max_num_features 800
