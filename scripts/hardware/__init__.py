# SPDX-License-Identifier: Apache-2.0
"""`make hardware`: a Linux kernel with real drivers and chips that are registers, as a process of this computer.

build.sh builds the kernel from kernel.config, machine.py boots it, init.py is its first process. guest/ is for programs inside:
chips, sticks, battery, lines, CAN. smoke.py shows that each works; flights.py flies the machine of craft/ on them."""
