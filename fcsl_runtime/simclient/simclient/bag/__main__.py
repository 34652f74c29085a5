import sys

from ..cli import run_tool

sys.exit(run_tool("fcsl bag", "bag.command", sys.argv[1:]))
