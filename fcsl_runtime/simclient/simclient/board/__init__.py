# SPDX-License-Identifier: Apache-2.0
"""Boards: the devices of this computer and the frontends of sensors, by the native library that flies."""
