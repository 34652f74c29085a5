# SPDX-License-Identifier: Apache-2.0
"""Markers of a coverage build, and the folder for its counts."""

#: Environment variable: the folder for coverage files of hosts (fcsl_cover.h).
COVER_DIR = "FCSL_COVER_DIR"
#: Appended to compiler and flags and thereby part of build_hash. A coverage build cannot be mistaken for a flight
#: build.
BUILD_NOTE = "for coverage"
