# SPDX-License-Identifier: Apache-2.0
"""Runs to look at: what there is to see in one, as a picture, and in the rerun viewer."""
