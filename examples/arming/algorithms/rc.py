"""What the channels of the remote control mean. Sticks and switches go from -1 to 1."""

from fcsl_builtins import f64

ROLL = 0
PITCH = 1
THROTTLE = 2
YAW = 3
STICKS = 4  # the first four are sticks, the others switches
ARM = 4
MODE = 5  # on: automatic
KILL = 6
ON: f64 = 0.5  # a switch is on above this
