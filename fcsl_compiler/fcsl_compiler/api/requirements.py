# SPDX-License-Identifier: Apache-2.0
"""Where the requirements of a machine stand in its sources and its C."""

from ..driver.requirement_places import RequirementPlaces, requirement_places

__all__ = ["RequirementPlaces", "requirement_places"]
