# SPDX-License-Identifier: Apache-2.0
"""Generates C, header, descriptor and ROS 2 messages of a machine."""
