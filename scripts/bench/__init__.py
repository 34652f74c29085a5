# SPDX-License-Identifier: Apache-2.0
"""`make bench`: figures.py takes all figures. subjects/ is what is measured, on machines/ of its own and of the examples; peers/ is
what it is compared with; harness/ compiles and times."""
