#!/usr/bin/env bash
# Builds the bridge of `make interop` into build/interop/bridge: once, and 11 minutes of a processor. cargo keeps what it built.
set -euo pipefail
cd "$(dirname "$0")/../.."
. scripts/common.sh
. scripts/underlay.sh
for tool in cmake g++; do
    type -P "$tool" > /dev/null || die "make interop needs $tool, which builds Cyclone DDS"
done
libclang=build/interop/libclang
if [ ! -d "$libclang/clang/native" ]; then
    progress "libclang for make interop (25 MB to download)" python3 -m pip install --disable-pip-version-check --progress-bar off \
        --no-deps --target "$libclang" -c constraints.txt -r scripts/interop/requirements.txt
fi
# libclang of PyPI brings no headers of the compiler: bindgen takes gcc's.
export LIBCLANG_PATH="$PWD/$libclang/clang/native"
BINDGEN_EXTRA_CLANG_ARGS="-I$(gcc -print-file-name=include)"
export BINDGEN_EXTRA_CLANG_ARGS
progress "bridge of make interop (the first time 11 minutes of a processor)" \
    cargo build --release --locked --manifest-path scripts/interop/Cargo.toml --target-dir build/interop/target
