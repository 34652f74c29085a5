# SPDX-License-Identifier: Apache-2.0
"""ROS 2 messages as bytes: their layout, and conversions that copy values from messages to a machine and back."""
