# SPDX-License-Identifier: Apache-2.0
"""Every limit of the supervisor. docs/guide/monitoring.md shows this table (test/test_limits.py)."""

#: ended runs that are kept; of more the oldest are forgotten
ENDED_RUNS = 16
#: bytes of telemetry that ended runs keep together; of more the oldest keep none
ENDED_WINDOW_BYTES = 256 << 20
#: bytes of output that are kept of a run
LOG_BYTES = 64 * 1024
#: bytes of a line of output; longer ones are cut
LOG_LINE_BYTES = 2048
#: bytes of a request's body
BODY_BYTES = 64 * 1024
#: lists and objects of a body inside each other
BODY_DEPTH = 32
#: bytes of a request's first line and headers
HEAD_BYTES = 16 * 1024
#: connections; further ones get an error, and beyond twice as many no answer
CONNECTIONS = 64
#: seconds from the connection to the end of the request's head
HEAD_S = 10.0
#: seconds for the rest of the request (then status 408)
BODY_S = 10.0
#: seconds from the connection to the end of the response
CONNECTION_S = 60.0
#: seconds that a start waits until the run serves its variables
START_S = 15.0
#: seconds that it then waits for the first telemetry
FIRST_TELEMETRY_S = 1.0
#: seconds from SIGTERM to SIGKILL
STOP_S = 6.0
#: seconds that the end of a killed process is waited for
KILL_S = 5.0
#: seconds for a reply of a run's variable server
STATUS_TIMEOUT_S = 2.0
#: seconds from the end of a run's socket to the end of its process
END_TIMEOUT_S = 1.0
#: seconds between two checks after which a tick that stood still means `stalled` (two periods, if that is longer)
STALLED_S = 2.0
#: scalars of a window, over all paths and ticks
WINDOW_VALUES = 1_000_000
#: paths of a request, with `machine.tick`
PATHS = 256
#: bytes of a path
PATH_BYTES = 1024
#: ticks of a run's telemetry that are kept
WINDOW_TICKS = 10_000
#: streams at a time
STREAMS = 8
#: values of a stream: numbers of all its paths, three of each quaternion
STREAM_VALUES = 64
#: points of a value in an update, and changes of state
STREAM_POINTS = 42
#: points of a value in the first update of a stream
STREAM_FIRST_POINTS = 1602
#: seconds between two updates of a stream
STREAM_PERIOD_S = 0.1
#: seconds between two summaries of all runs
SUMMARY_PERIOD_S = 1.0
#: seconds after which a reader of a stream that takes nothing is dropped
STREAM_STALL_S = 5.0
#: bytes that a stream leaves in the kernel for its reader (which may keep twice as many)
STREAM_SEND_BYTES = 64 * 1024
