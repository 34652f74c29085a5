# SPDX-License-Identifier: Apache-2.0
"""What a build for coverage is marked with, and where hosts leave its counts."""

#: Environment: the folder that hosts keep coverage in, as fcsl_cover.h names it.
COVER_DIR = "FCSL_COVER_DIR"
#: Added to compiler and flags, and so in build_hash: no build for coverage passes for one that flies.
BUILD_NOTE = "for coverage"
