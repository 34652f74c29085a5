# SPDX-License-Identifier: Apache-2.0
"""Every bound of the supervisor. Sizes in bytes, times in seconds."""

#: Ended runs that are kept; beyond it the oldest are dropped.
ENDED_RUNS = 16
#: Telemetry that ended runs keep in total; beyond it the oldest keep none.
ENDED_WINDOW_BYTES = 256 << 20

#: The output of a run that is kept: its last lines, up to this total; longer lines are truncated.
LOG_BYTES, LOG_LINE_BYTES = 64 * 1024, 2048

BODY_BYTES = 64 * 1024
#: Nesting depth of lists and objects in a body.
BODY_DEPTH = 32
#: Size of a request's first line and headers.
HEAD_BYTES = 16 * 1024
#: Connections beyond this number get an error; beyond twice this number they get no answer.
CONNECTIONS = 64
#: Timeouts: from the connection to the end of the request's head, to the end of its body, to the end of the response.
HEAD_S, BODY_S, CONNECTION_S = 10.0, 10.0, 60.0

#: How long a start request waits until the run serves its variables.
START_S = 15.0
#: How long it waits for the first telemetry of a run that serves its variables.
FIRST_TELEMETRY_S = 1.0
#: Time from SIGTERM to SIGKILL; a flight needs up to 3 s.
STOP_S = 6.0
#: Longest wait after SIGKILL: the kernel keeps a process that waits for a device or disk without an answer.
KILL_S = 5.0
#: Timeout of a reply of a run's variable server.
LOOK_S = 2.0
#: Longest time from the end of a run's socket to the end of its process.
GONE_S = 1.0
#: A run that is not paused is stalled if its tick does not advance between two checks this far apart, or for two periods.
STALLED_S = 2.0

#: Scalars of one window, over all paths and ticks.
WINDOW_VALUES = 1_000_000
#: Paths of one request for values or a window: the limit of the variable server.
PATHS = 256
PATH_BYTES = 1024
#: Most ticks kept of a run's telemetry; with large bodies the receiver keeps fewer.
WINDOW_TICKS = 10_000
