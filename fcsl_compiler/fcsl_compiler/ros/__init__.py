# SPDX-License-Identifier: Apache-2.0
"""Conversions between ROS 2 messages and values: what is read from and written to a message, for C to execute."""
