# SPDX-License-Identifier: Apache-2.0
"""fcsl hal: bringing up the sensors and actuators of a vehicle (docs/hardware/hal.md)."""
