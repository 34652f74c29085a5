# SPDX-License-Identifier: Apache-2.0
## Models in Nim: makes the descriptor of fcsl_model.h from an object type, at compile time. Nothing here allocates, and no
## code runs when the library is loaded.
##
##   import fcsl_model
##
##   type Tank = object
##     inputs: tuple[flow: float64]
##     parameters: tuple[area: float64]
##     state: tuple[level: float64] # continuous states first, float64 only
##     outputs: tuple[level: float64]
##
##   proc derivative(self: ptr Tank, t: float64, x, dx: States) {.exportc, cdecl.} =
##     dx[0] = self.inputs.flow / self.parameters.area
##
##   proc output(self: ptr Tank, t: float64, x: States) {.exportc, cdecl.} =
##     self.outputs.level = x[0]
##
##   exportModel("tank", "a tank that is filled", Tank, continuous = 1, functions = ["derivative", "output"], fields = [
##     field(Tank, Input, inputs.flow, "m^3/s", "into the tank"),
##     field(Tank, Parameter, parameters.area, "m^2", ""),
##     field(Tank, State, state.level, "m", ""),
##     field(Tank, Output, outputs.level, "m", ""),
##   ])
##
## The procs are those of fcsl_model_t, by their names: `init`, `derivative`, `output`, `update`, `event`,
## `reset`, `next_time`.

import std/macros

type
  Role* = enum
    Input, Output, Feedthrough, Parameter, State, OptionalInput, OptionalParameter
  States* = ptr UncheckedArray[float64]
    ## Continuous states, or their derivatives, or values of event functions.
  Context* {.importc: "fcsl_model_context_t", header: "fcsl/fcsl_model.h".} = object
    ## What init, update and reset get. Its other members are reached by `gaussian` and `uniform`.
    time_ns*: int64
    noise: pointer
    gaussian {.importc: "gaussian".}: proc (noise: pointer, stream: uint32): float64 {.cdecl, raises: [].}
    uniform {.importc: "uniform".}: proc (noise: pointer, stream: uint32): float64 {.cdecl, raises: [].}
  Field* = object
    path, role, scalar, unit, doc: string
    offset, size: int
    shape: seq[int]
  Event* = object
    name, crossing, doc: string
  Crossing* = enum
    Falling, Rising, Either

proc gaussian*(context: ptr Context, stream: uint32): float64 {.inline.} =
  ## Mean 0, standard deviation 1; NaN: no such stream.
  context.gaussian(context.noise, stream)

proc uniform*(context: ptr Context, stream: uint32): float64 {.inline.} =
  ## In [0, 1); NaN: no such stream.
  context.uniform(context.noise, stream)

# ---- correctly rounded functions of fcsl_math ----

{.push header: "fcsl/fcsl_math.h", importc, raises: [].}
proc cr_sin*(x: float64): float64
proc cr_cos*(x: float64): float64
proc cr_tan*(x: float64): float64
proc cr_asin*(x: float64): float64
proc cr_acos*(x: float64): float64
proc cr_atan*(x: float64): float64
proc cr_atan2*(y, x: float64): float64
proc cr_sinh*(x: float64): float64
proc cr_cosh*(x: float64): float64
proc cr_tanh*(x: float64): float64
proc cr_exp*(x: float64): float64
proc cr_expm1*(x: float64): float64
proc cr_log*(x: float64): float64
proc cr_log1p*(x: float64): float64
proc cr_log2*(x: float64): float64
proc cr_log10*(x: float64): float64
proc cr_pow*(x, y: float64): float64
proc cr_cbrt*(x: float64): float64
proc cr_hypot*(x, y: float64): float64
{.pop.}
{.push header: "<math.h>", importc, raises: [].}
proc sqrt*(x: float64): float64
proc fabs*(x: float64): float64
proc floor*(x: float64): float64
proc fmin*(x, y: float64): float64
proc fmax*(x, y: float64): float64
proc fmod*(x, y: float64): float64
{.pop.}

# ---- the table of fields, at compile time ----

proc scalarOf(T: typedesc[bool]): string {.compileTime.} = "FCSL_BOOL"
proc scalarOf(T: typedesc[int32]): string {.compileTime.} = "FCSL_I32"
proc scalarOf(T: typedesc[int64]): string {.compileTime.} = "FCSL_I64"
proc scalarOf(T: typedesc[uint32]): string {.compileTime.} = "FCSL_U32"
proc scalarOf(T: typedesc[uint64]): string {.compileTime.} = "FCSL_U64"
proc scalarOf(T: typedesc[float32]): string {.compileTime.} = "FCSL_F32"
proc scalarOf(T: typedesc[float64]): string {.compileTime.} = "FCSL_F64"

template described(T: typedesc): (string, seq[int]) =
  ## Scalar and shape of a member.
  when T is array:
    when typeof(default(T)[low(T)]) is array:
      (scalarOf(typeof(default(T)[low(T)][0])), @[len(T), len(typeof(default(T)[low(T)]))])
    else:
      (scalarOf(typeof(default(T)[low(T)])), @[len(T)])
  else:
    (scalarOf(T), newSeq[int]())

macro member(base, path: untyped): untyped =
  ## base.path, where path is `inputs.flow`.
  if path.kind == nnkDotExpr: newDotExpr(newCall(bindSym"member", base, path[0]), path[1]) else: newDotExpr(base, path)

macro offsetIn(Model: typedesc, path: untyped): untyped =
  ## Bytes from the start of Model to `inputs.flow`.
  if path.kind != nnkDotExpr:
    return newCall(ident"offsetOf", Model, path)
  let part = newCall(ident"typeof", newDotExpr(newCall(ident"default", Model), path[0]))
  infix(newCall(ident"offsetOf", Model, path[0]), "+", newCall(ident"offsetOf", part, path[1]))

template field*(Model: typedesc, kind: Role, place: untyped, inUnits, says: static string): Field =
  ## One field: `place` is a member, such as `inputs.flow` or `state.rate` (an array has a shape).
  block:
    type Member = typeof(member(default(Model), place))
    const found = described(Member)
    Field(path: astToStr(place), role: $kind, scalar: found[0], unit: inUnits, doc: says,
          offset: offsetIn(Model, place), size: sizeof(Member), shape: found[1])

proc event*(name: string, crossing: Crossing, doc: string): Event {.compileTime.} =
  ## An event function: which change of its sign counts.
  Event(name: name, crossing: $crossing, doc: doc)

proc quoted(text: string): string {.compileTime.} =
  result = "\""
  for c in text:
    if c in {'"', '\\'}: result.add('\\')
    result.add(c)
  result.add('"')

proc row(f: Field, number: int): string {.compileTime.} =
  const roles = [("Input", "FCSL_ROLE_INPUT", "0u"), ("Output", "FCSL_ROLE_OUTPUT", "0u"),
                 ("Feedthrough", "FCSL_ROLE_OUTPUT", "FCSL_FIELD_FEEDTHROUGH"), ("Parameter", "FCSL_ROLE_PARAMETER", "0u"),
                 ("State", "FCSL_ROLE_STATE", "0u"), ("OptionalInput", "FCSL_ROLE_INPUT", "FCSL_FIELD_OPTIONAL"),
                 ("OptionalParameter", "FCSL_ROLE_PARAMETER", "FCSL_FIELD_OPTIONAL")]
  var role, flags: string
  for (name, c, flag) in roles:
    if name == f.role: (role, flags) = (c, flag)
  var count = 1
  for extent in f.shape: count *= extent
  let shape = if f.shape.len > 0: "fcsl_shape_" & $number else: "NULL"
  "{" & quoted(f.path) & ", " & role & ", " & f.scalar & ", " & flags & ", " & $f.shape.len & "u, " & shape & ", " &
    $count & "u, " & $f.offset & "u, " & $f.size & "u, FCSL_NONE, FCSL_NONE, " & quoted(f.unit) & ", " & quoted(f.doc) &
    ", -(double)INFINITY, (double)INFINITY},\n"

proc descriptor(name, doc: string, fields: openArray[Field], events: openArray[Event], functions: openArray[string],
                size, align, state, continuous: int, secondOrder: bool, sampled: int): string {.compileTime.} =
  ## The C of the descriptor.
  result = "/*VARSECTION*/\n"
  for number, f in fields:
    if f.shape.len > 0:
      result.add("static const uint32_t fcsl_shape_" & $number & "[] = {")
      for extent in f.shape: result.add($extent & "u, ")
      result.add("};\n")
  result.add("static const fcsl_field_t fcsl_model_fields[] = {\n")
  for number, f in fields: result.add(row(f, number))
  result.add("};\n")
  if events.len > 0:
    result.add("static const fcsl_model_event_t fcsl_model_events[] = {\n")
    for e in events:
      let crossing = case e.crossing
        of "Falling": "FCSL_FALLING"
        of "Rising": "FCSL_RISING"
        else: "FCSL_EITHER"
      result.add("{" & quoted(e.name) & ", " & crossing & ", " & quoted(e.doc) & "},\n")
    result.add("};\n")
  result.add("static const fcsl_model_t fcsl_model = {\n.abi_version = FCSL_MODEL_ABI_VERSION,\n.name = " & quoted(name) &
    ",\n.doc = " & quoted(doc) & ",\n.fields = fcsl_model_fields,\n.field_count = " & $fields.len & "u,\n.size = " & $size &
    "u,\n.align = " & $align & "u,\n.continuous_offset = " & $state & "u,\n.continuous_count = " & $continuous &
    "u,\n.is_second_order = " & (if secondOrder: "1u" else: "0u") & ",\n.sampled_offset = " &
    (if sampled >= 0: $sampled & "u" else: "FCSL_NO_OFFSET") & ",\n")
  if events.len > 0:
    result.add(".events = fcsl_model_events,\n.event_count = " & $events.len & "u,\n")
  for f in functions: result.add("." & f & " = (void *)" & f & ",\n")
  result.add("};\n__attribute__((visibility(\"default\"))) const fcsl_model_t *const fcsl_models[] = {&fcsl_model, NULL};\n")

type
  InitProc[M] = proc (self: ptr M, context: ptr Context): cstring {.cdecl.}
  DerivativeProc[M] = proc (self: ptr M, t: float64, x, dx: States) {.cdecl.}
  OutputProc[M] = proc (self: ptr M, t: float64, x: States) {.cdecl.}
  UpdateProc[M] = proc (self: ptr M, context: ptr Context) {.cdecl.}
  EventProc[M] = proc (self: ptr M, t: float64, x, value: States) {.cdecl.}
  ResetProc[M] = proc (self: ptr M, context: ptr Context, number: uint32) {.cdecl.}
  NextTimeProc[M] = proc (self: ptr M, t: float64): float64 {.cdecl.}

macro checkFunctions(Model: typedesc, functions: static openArray[string]): untyped =
  ## Refuses procs of other types than fcsl_model_t has: C does not see them.
  result = newStmtList()
  for name in functions:
    let kind = case name
      of "init": bindSym"InitProc"
      of "derivative": bindSym"DerivativeProc"
      of "output": bindSym"OutputProc"
      of "update": bindSym"UpdateProc"
      of "event": bindSym"EventProc"
      of "reset": bindSym"ResetProc"
      of "next_time": bindSym"NextTimeProc"
      else:
        error("there is no function `" & name & "`: see the first lines of fcsl_model")
        return
    let wanted = nnkBracketExpr.newTree(kind, Model)
    let wrong = newLit("`" & name & "` has other parameters or another result than fcsl_model says")
    let function = ident(name)
    result.add quote do:
      when not compiles((let chosen: `wanted` = `function`; discard chosen)): # there may be others of its name
        {.error: `wrong`.}

macro emitted(text: static string): untyped =
  nnkPragma.newTree(nnkExprColonExpr.newTree(ident("emit"), nnkBracket.newTree(newStrLitNode(text))))

template exportModel*(name, doc: static string, Model: typedesc, fields: untyped, functions: static openArray[string],
                      continuous: static int = 0, secondOrder: static bool = false, events: untyped = newSeq[Event](),
                      sampled: static int = -1) =
  ## Exports the model. `continuous`: number of float64 at the beginning of `state` that the simulator integrates;
  ## `secondOrder`: the first half are positions, the second half their velocities. `events`: in the order of the values
  ## that `event` writes. `sampled`: offsetOf of a bool that `update` sets to false where it takes no sample.
  when continuous > 0:
    const at = offsetOf(Model, state)
  else:
    const at = 0
  checkFunctions(Model, functions)
  const text = descriptor(name, doc, fields, events, functions, sizeof(Model), alignof(Model), at, continuous,
                          secondOrder, sampled)
  emitted(text)
