# SPDX-License-Identifier: Apache-2.0
"""Keeps ROS 2 traffic on this machine unless the user says otherwise."""

from __future__ import annotations

from collections.abc import Mapping

from fcsl_compiler.base.ament import package_share

#: Both names are read by Fast DDS; either one set by the user wins.
_PROFILE_VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"


def loopback_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Variables to add so that Fast DDS binds 127.0.0.1 and nothing else; none when `environment` chose for itself.

    A profile of the user's own or a discovery range wider than this machine is such a choice. LOCALHOST is not: it means
    what the profile does, but leaves the sockets open to every interface.
    """
    chosen = any(environment.get(name) for name in _PROFILE_VARIABLES)
    if chosen or environment.get(_RANGE, "LOCALHOST") not in ("", "LOCALHOST"):
        return {}
    profile = package_share("fcsl_bridge") / "config" / "fastdds_loopback.xml"
    return {_PROFILE_VARIABLES[0]: str(profile), _RANGE: "SYSTEM_DEFAULT"}
