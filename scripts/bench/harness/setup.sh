#!/usr/bin/env bash
# `make bench` begins here: the peers that it measures, besides what `make setup` brings. Returns at once where they are there.
set -euo pipefail
cd "$(dirname "$0")/../../.."
. scripts/common.sh
. scripts/apt.sh
. scripts/underlay.sh
pip_install() { python3 -m pip install --disable-pip-version-check --progress-bar off -c constraints.txt "$@"; }
if ! python3 -c 'import casadi, colorama, jsbsim, numba, pymavlink, tqdm' 2> /dev/null; then
    progress "peers of make bench (160 MB to download)" pip_install -r scripts/bench/harness/requirements.txt
fi
if ! python3 -c 'import Basilisk' 2> /dev/null; then
    progress "Basilisk for make bench (73 MB to download, 270 MB on disk)" pip_install --no-deps bsk
fi
if [ ! -d /usr/include/eigen3 ] || ! type -P cyclictest > /dev/null; then
    package_lists
    install_packages "peers of make bench" "make bench" libeigen3-dev rt-tests
fi
