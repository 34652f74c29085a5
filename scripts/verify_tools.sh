#!/usr/bin/env bash
# `make verify` begins here: the tools that it needs besides those of `make setup`, from PyPI and as packages of the distribution.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
. scripts/apt.sh
. scripts/underlay.sh
python_packages "tools of make verify (100 MB to download)" --group verify
missing() { comm -23 <(grep -o '^[^ #]*' scripts/verify-packages.txt | sort) <(dpkg-query -W -f '${db:Status-Abbrev} ${Package}\n' 2> /dev/null | sed -n 's/^ii  *//p' | sort -u); }
if [ -z "$(missing)" ]; then exit; fi
package_lists
# shellcheck disable=SC2046 # a list of words
install_packages "tools of make verify" "make verify" $(missing)
