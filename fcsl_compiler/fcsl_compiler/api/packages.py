# SPDX-License-Identifier: Apache-2.0
"""Installed packages: their prefixes, and the files that they share."""

from ..base.packages import Package, PackageNotFound, installed_packages, package_prefix, package_share

__all__ = [
    "Package",
    "PackageNotFound",
    "installed_packages",
    "package_prefix",
    "package_share",
]
