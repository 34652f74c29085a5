#!/usr/bin/env bash
# `make wheels`: the wheel `fcsl` in out/wheels, from the packages up to fcsl_sim and fcsl_blocks and their own CMake install. zig
# compiles them anew, for any x86-64 with glibc 2.28; Rust is the workspace's.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
unset AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH PYTHONPATH
# Nothing that is for this processor alone. cargo notices if the workspace was built with other flags, and compiles anew.
unset CC CFLAGS CPPFLAGS CXXFLAGS LDFLAGS RUSTFLAGS CARGO_ENCODED_RUSTFLAGS CARGO_BUILD_RUSTFLAGS
. scripts/underlay.sh
unset COLCON_DEFAULTS_FILE # no links: what is installed here is packed
python_packages "tools of make wheels (100 MB to download)" --group wheels
build=build/wheels
# CMake notices neither another zig nor other options.
key=$(cat scripts/wheels.sh scripts/wheels/cc fcsl_compiler/fcsl_compiler/driver/toolchain.py constraints.txt | sha256sum)
if [ "$key" != "$(cat "$build/.key" 2> /dev/null)" ]; then rm -rf "$build"; fi
mkdir -p "$build/fcsl_hal"
echo "$key" > "$build/.key"
ln -sfn "$root/build/fcsl_hal/cargo" "$build/fcsl_hal/cargo"
export PYTHONPATH="$root/fcsl_compiler${PYTHONPATH:+:$PYTHONPATH}" CMAKE_GENERATOR=Ninja
progress "native parts of the wheel" colcon --log-base log/wheels build --packages-up-to fcsl_sim fcsl_blocks \
    --build-base "$build" --install-base "$build/install" --merge-install --cmake-args \
    -DCMAKE_BUILD_TYPE=Release -DCMAKE_C_COMPILER="$root/scripts/wheels/cc" -DCMAKE_EXE_LINKER_FLAGS=-pie -DCMAKE_SHARED_LINKER_FLAGS=-Wl,--no-undefined -DBUILD_TESTING=OFF \
    -DCMAKE_INSTALL_RPATH_USE_LINK_PATH=OFF -DAMENT_CMAKE_ENVIRONMENT_PACKAGE_GENERATION=OFF \
    -DAMENT_CMAKE_ENVIRONMENT_PARENT_PREFIX_PATH_GENERATION=OFF
python3 scripts/wheels/pack.py "$build" out/wheels
