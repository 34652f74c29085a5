# SPDX-License-Identifier: Apache-2.0
## A tank that is filled and drains through a hole in its bottom (E. Torricelli, 1643):
##
##   area level' = flow - hole sqrt(2 gravity level)
##
## It overflows where the level reaches the rim.
import fcsl_model

type Tank = object
  inputs: tuple[flow: float64]
  parameters: tuple[area, hole, gravity, rim, level: float64]
  state: tuple[level: float64, overflows: uint32]
  outputs: tuple[level, drain: float64, overflows: uint32]

proc drain(self: ptr Tank, level: float64): float64 {.inline.} =
  ## m^3/s
  self.parameters.hole * sqrt(2.0 * self.parameters.gravity * fmax(level, 0.0))

proc init(self: ptr Tank, context: ptr Context): cstring {.exportc, cdecl.} =
  if not (self.parameters.area > 0.0):
    return "parameters.area must be positive"
  self.state.level = self.parameters.level
  return nil

proc derivative(self: ptr Tank, t: float64, x, dx: States) {.exportc, cdecl.} =
  dx[0] = (self.inputs.flow - drain(self, x[0])) / self.parameters.area

proc output(self: ptr Tank, t: float64, x: States) {.exportc, cdecl.} =
  self.outputs.level = x[0]
  self.outputs.drain = drain(self, x[0])
  self.outputs.overflows = self.state.overflows

proc event(self: ptr Tank, t: float64, x, value: States) {.exportc, cdecl.} =
  value[0] = self.parameters.rim - x[0]

proc reset(self: ptr Tank, context: ptr Context, number: uint32) {.exportc, cdecl.} =
  self.state.level = 0.9 * self.parameters.rim # what spills
  self.state.overflows += 1

exportModel(
  "tank", "a tank with a hole", Tank, continuous = 1,
  functions = ["init", "derivative", "output", "event", "reset"],
  events = [event("overflow", Falling, "the level reaches the rim")],
  fields = [
    field(Tank, Input, inputs.flow, "m^3/s", "into the tank"),
    field(Tank, Parameter, parameters.area, "m^2", "of the surface"),
    field(Tank, Parameter, parameters.hole, "m^2", "of the hole"),
    field(Tank, Parameter, parameters.gravity, "m/s^2", ""),
    field(Tank, Parameter, parameters.rim, "m", "its height above the hole"),
    field(Tank, Parameter, parameters.level, "m", "at the start"),
    field(Tank, State, state.level, "m", "above the hole"),
    field(Tank, State, state.overflows, "", ""),
    field(Tank, Output, outputs.level, "m", "above the hole"),
    field(Tank, Output, outputs.drain, "m^3/s", "through the hole"),
    field(Tank, Output, outputs.overflows, "", "how often it has spilled"),
  ],
)
