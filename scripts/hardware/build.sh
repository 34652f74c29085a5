#!/usr/bin/env bash
# Builds the kernel of `make hardware`, Linux as a process of this computer, and prints its path. It is built once
# for a version of Debian's source and of kernel.config, in the cache of fcslc; a second run returns at once. All else that it says
# goes to standard error. With --if-built it builds nothing, and ends with status 77 where there is none.
set -euo pipefail
exec 3>&1 1>&2
cd "$(dirname "$0")/../.."
. scripts/common.sh
. scripts/apt.sh
packages=scripts/hardware/packages.txt
config=$PWD/scripts/hardware/kernel.config
source=linux-source-6.1
cache=${FCSL_CACHE_DIR:-${XDG_CACHE_HOME:-$HOME/.cache}/fcsl}

missing() { comm -23 <(grep -o '^[^ #]*' "$packages" | sort) <(dpkg-query -W -f '${db:Status-Abbrev} ${Package}\n' 2> /dev/null | sed -n 's/^ii  *//p' | sort -u); }

unpack() { tar -xf "/usr/src/$source.tar.xz" -C "$1"; }

# A line of kernel.config that this kernel does not know, or cannot have, is an error.
configure() {
    make -C "$1" ARCH=um KCONFIG_ALLCONFIG="$config" allnoconfig
    ! grep '^CONFIG' "$config" | grep -vxFf "$1/.config"
}

build() {
    unpack "$1"
    configure "$1/$source"
    nice make -C "$1/$source" ARCH=um -j"$(nproc)" linux modules
    mkdir "$1/built"
    strip -o "$1/built/linux" "$1/$source/linux"
    cp "$1/$source/drivers/i2c/i2c-stub.ko" "$1/built"
}

if [ "${1:-}" = --if-built ] && { [ "$(uname -m)" != x86_64 ] || [ -n "$(missing)" ]; }; then exit 77; fi
if [ "$(uname -m)" != x86_64 ]; then die "make hardware: user-mode Linux runs on x86-64 only"; fi
if [ -n "$(missing)" ]; then
    package_lists
    # shellcheck disable=SC2046 # a list of words
    install_packages "tools of make hardware" "make hardware" $(missing)
fi
version=$(dpkg-query -W -f '${Version}' "$source")
kernel=$cache/uml-$( (echo "$version" && cat "$config") | sha256sum | cut -c 1-16)
if [ "${1:-}" = --if-built ] && [ ! -x "$kernel/linux" ]; then exit 77; fi
if [ ! -x "$kernel/linux" ]; then
    (umask 077 && mkdir -p "$cache")
    exec 4> "$cache/uml.lock"
    flock 4 # another run may be building it
fi
if [ ! -x "$kernel/linux" ]; then
    work=$(mktemp -d "$cache/uml-work.XXXXXX")
    trap 'rm -rf "$work"' EXIT
    export -f unpack configure build
    export source config
    progress "kernel of make hardware (once; 5 minutes of a processor, 2 GB while it lasts)" bash -euo pipefail -c "build '$work'"
    mv -T "$work/built" "$kernel"
fi
echo "$kernel/linux" >&3
