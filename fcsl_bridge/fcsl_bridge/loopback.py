# SPDX-License-Identifier: Apache-2.0
"""Keeps ROS 2 traffic on this computer unless the user configured otherwise."""

from __future__ import annotations

from collections.abc import Mapping

from fcsl_compiler.api.packages import package_share

#: Fast DDS reads both variables; if the user set one of them, it has precedence.
_PROFILE_VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"


def loopback_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Variables that make Fast DDS bind to 127.0.0.1 only; none if `environment` already configures it.

    A user's own profile or a discovery range wider than this computer counts as configured. LOCALHOST does not: it has
    the effect of the profile, but leaves the sockets open on every interface.
    """
    chosen = any(environment.get(name) for name in _PROFILE_VARIABLES)
    if chosen or environment.get(_RANGE, "LOCALHOST") not in ("", "LOCALHOST"):
        return {}
    profile = package_share("fcsl_bridge") / "config" / "fastdds_loopback.xml"
    return {_PROFILE_VARIABLES[0]: str(profile), _RANGE: "SYSTEM_DEFAULT"}
