# SPDX-License-Identifier: Apache-2.0
"""Algorithm files: declarations, types, bodies; from syntax trees to checked IR."""
