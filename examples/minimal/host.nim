# SPDX-License-Identifier: Apache-2.0
# Hosts the machine in a Nim program:
#
#   fcsl build --backend nim examples/minimal/minimal.json -o out
#   nim c -r -d:release --path:out --passC:"-I install/fcsl_compiler/include -ffp-contract=off" \
#     --passL:"install/fcsl_compiler/lib/libfcsl_math.a -lm" --out:out/host examples/minimal/host.nim
import minimal

var machine: Minimal
var host: Host # without clock and hardware

if initMachine(machine) != 0:
  quit("an instance could not start")
for tick in 0 ..< 5:
  # The source instance has the measured values as outputs.
  machine.i_sensors.outputs.theta = 0.1 * float64(tick)
  step(machine, host)
  echo tick, " ", machine.i_pilot.outputs.force
