# SPDX-License-Identifier: Apache-2.0
"""Displays of a run: its signals, a picture, and a scene for the rerun viewer."""
