# SPDX-License-Identifier: Apache-2.0
"""Does what `ros2 fcsl VERB ARGUMENTS ...` does, for tests: they have no `ros2`."""

import argparse
import sys
from importlib.metadata import entry_points


def main(given: list[str]) -> int | str:
    (entry,) = entry_points(group="ros2fcsl.verb", name=given[0])
    verb = entry.load()()
    parser = argparse.ArgumentParser(prog=f"ros2 fcsl {given[0]}")
    verb.add_arguments(parser, "ros2 fcsl")
    return verb.main(args=parser.parse_args(given[1:]))  # type: ignore[no-any-return]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
