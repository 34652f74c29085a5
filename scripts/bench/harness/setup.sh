#!/usr/bin/env bash
# `make bench` begins here: the peers that it measures, besides what `make setup` brings. Returns at once where they are there.
set -euo pipefail
cd "$(dirname "$0")/../../.."
. scripts/common.sh
. scripts/apt.sh
. scripts/underlay.sh
python_packages "peers of make bench (160 MB to download)" --group bench
# Basilisk asks for older versions of packages that FCSL has.
python_packages "Basilisk for make bench (73 MB to download, 270 MB on disk)" --no-deps --group basilisk
if [ ! -d /usr/include/eigen3 ] || ! type -P cyclictest > /dev/null; then
    package_lists
    install_packages "peers of make bench" "make bench" libeigen3-dev rt-tests
fi
