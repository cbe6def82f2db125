#!/usr/bin/env bash
# usage: install_test.sh BUILD SOURCE: installs cairn; builds and runs with it the examples, and a program that wants
# averaging alone, on a machine without the packages of other modules.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

configure() {  # configure SOURCE NAME [cmake arguments ...]
  cmake -S "$1" -B "$folder/$2" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$folder/prefix" "${@:3}"
}
fails_with() {  # fails_with TEXT cmake arguments ...: tests/integration/install is not configured, and says so
  if configure "$2/tests/integration/install" refused "${@:3}" >"$folder/refused.log" 2>&1 ||
    ! tr -s ' \n' ' ' <"$folder/refused.log" | grep -qF "$1"; then
    echo "expected a failure with: $1" && cat "$folder/refused.log" && exit 1
  fi
}

cmake --install "$1" --prefix "$folder/prefix" >"$folder/install.log" || { cat "$folder/install.log"; exit 1; }
"$folder/prefix/bin/global_sfm" --help >/dev/null
"$folder/prefix/bin/build_view_graph" --help >/dev/null

configure "$2/apps/examples" examples
cmake --build "$folder/examples"
"$folder/examples/examples/average_rotations" nowhere nowhere && exit 1 || [ $? = 2 ]

others=()
for package in CLI11 Ceres Lensfun OpenCV SQLite3 exiv2 nlohmann_json spdlog tomlplusplus; do
  others+=("-DCMAKE_DISABLE_FIND_PACKAGE_$package=ON")
done
configure "$2/tests/integration/install" averaging "${others[@]}"
cmake --build "$folder/averaging"
"$folder/averaging/cairn_user"

fails_with "there is no component 'averagin'; there are: base" "$2" -DCOMPONENTS=averagin
fails_with "component 'features' needs OpenCV, which was not found" "$2" \
  "-DCOMPONENTS=averaging;features" -DCMAKE_DISABLE_FIND_PACKAGE_OpenCV=ON
