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
    python_packages "libclang for make interop (25 MB to download)" --no-deps --target "$libclang" --group interop
fi
# libclang of PyPI brings no headers of the compiler: bindgen takes gcc's.
export LIBCLANG_PATH="$PWD/$libclang/clang/native"
BINDGEN_EXTRA_CLANG_ARGS="-I$(gcc -print-file-name=include)"
export BINDGEN_EXTRA_CLANG_ARGS
progress "bridge of make interop (the first time 11 minutes of a processor)" \
    cargo build --release --locked --manifest-path scripts/interop/Cargo.toml --target-dir build/interop/target
