# SPDX-License-Identifier: Apache-2.0
"""Machines on the ROS graph as a client sees them, and the command `ros2 fcsl`."""
