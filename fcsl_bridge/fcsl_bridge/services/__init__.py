# SPDX-License-Identifier: Apache-2.0
"""Requests of ROS 2 to a machine, carried out between two ticks: services, parameters, injected dropouts."""
