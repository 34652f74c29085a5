import sys

from ..cli import run_tool

sys.exit(run_tool("fcsl replay", "replay.command", sys.argv[1:]))
