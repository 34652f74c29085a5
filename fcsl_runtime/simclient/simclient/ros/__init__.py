# SPDX-License-Identifier: Apache-2.0
"""ROS 2 messages as bytes: their layout, and plans of what goes from a message to a machine and back."""
