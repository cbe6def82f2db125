#!/usr/bin/env bash
# usage: install_test.sh BUILD_FOLDER SOURCE_OF_USER: installs cairn, builds a program with find_package(cairn), runs it.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cmake --install "$1" --prefix "$folder/prefix" >"$folder/install.log" || { cat "$folder/install.log"; exit 1; }
"$folder/prefix/bin/global_sfm" --help >/dev/null
"$folder/prefix/bin/build_view_graph" --help >/dev/null
cmake -S "$2" -B "$folder/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$folder/prefix"
cmake --build "$folder/build"
"$folder/build/cairn_user"
