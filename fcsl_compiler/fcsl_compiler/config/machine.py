# SPDX-License-Identifier: Apache-2.0
"""Checks a machine: from the values of its JSON to a checked Machine. Reports all errors in one run."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from ..base.diagnostics import DiagnosticSink, Note, Severity, misspelt, nearest
from ..base.source import Span
from ..check.algorithm import check_algorithm
from ..check.algorithm_class import AlgorithmClass, size_variables
from ..check.breakpoints import check_breakpoints
from ..check.declarations import Declarations
from ..check.finite import with_finite_results
from ..check.frozen import Freezer
from ..check.loop_bounds import check_loops
from ..check.modules import Modules
from ..check.nan_comparisons import warn_nan_comparisons
from ..model import ir
from ..model.machine import Connection, Edge, Instance, Machine, PortRef, Values
from ..model.program import Program
from ..model.ranges import UNBOUNDED
from ..model.types import REQUEST, element_of
from ..parse.json_reader import ConfigReader, Everything
from ..parse.json_source import JsonNode
from ..parse.machine_files import ParsedAlgorithm, ParsedMachine
from ..parse.parts import MAX_TICK_HZ, RESERVED_INSTANCES
from .arming import read_arming
from .channels import read_channels, read_payload
from .part_requests import bind_requests, check_listed
from .part_structs import check_structs
from .ports import PortResolver
from .sources import SourceResolver
from .states import read_states
from .structs import read_structs
from .transitions import read_transitions
from .views import Signals, is_partial, read_views

#: What becomes of a NaN or an infinity in outputs and state: it is passed on, or the run fails.
NAN = ("pass", "fail")
#: Checked algorithms by name, in JSON order. None: an error was reported.
Algorithms = dict[str, ir.Algorithm | None]


def check_machine(parsed: ParsedMachine, sink: DiagnosticSink) -> Machine | None:
    """Checks the machine and all its algorithms. Returns None if an error was reported, here or while parsing."""
    reader, keys = ConfigReader(sink, parsed.constants), parsed.keys
    reader.scopes = parsed.joined.scopes
    program = Program(read_structs(keys.get("structs"), reader))
    tick_hz = reader.integer(keys.get("tick_hz"), "tick_hz", 1, MAX_TICK_HZ, "Hz") or 0
    modules = _modules(parsed, program, reader)
    algorithms = _check_algorithms(parsed, modules, reader)
    defined = keys["algorithms"].kind == "object" if "algorithms" in keys else False
    nan = reader.choice(keys.get("nan"), "`nan`", NAN) or NAN[0]
    instances, incomplete = _read_instances(keys.get("instances"), algorithms if defined else None, nan, reader)
    _warn_unused(parsed, algorithms, instances, incomplete, sink)
    ports = PortResolver(instances, incomplete, SourceResolver(keys.get("channels"), sink), sink)
    if not _check_ports(parsed, ports):
        return None
    connections = _read_connections(keys.get("connections"), ports, reader)
    channels = read_channels(keys, tick_hz, ports, connections, reader)
    payload = read_payload(keys.get("bus"), reader)
    arm, command_timeout_ns = read_arming(keys, tick_hz, ports, channels, reader)
    instances = _with_initial_inputs(keys.get("instances"), instances, connections, reader)
    scheduled = [i.name for i in instances]
    states = read_states(keys.get("states"), keys.get("always"), tick_hz, scheduled, incomplete, reader)
    names = [s.name for s in states]
    initial: int | None = None
    requests: list[str] = []
    edges: list[Edge] = []
    if names:  # otherwise it was reported
        initial = reader.reference(keys.get("initial_state"), "state", names)
        requests, edges = read_transitions(keys, tick_hz, names, instances, incomplete, reader)
    instances = _read_publish(keys.get("publish"), instances, incomplete, reader)
    views = read_views(keys.get("views"), _signals(instances, incomplete), Path(parsed.source.path), reader)
    check_breakpoints(instances, program, sink)
    if sink.failed or initial is None:
        return None
    modules.warn_unused([c.port.declared for c in channels if c.direction == "sensor"])
    entries = [f for a in algorithms.values() if a is not None for f in (a.execute, a.start) if f is not None]
    warn_nan_comparisons([*program.helpers.values(), *entries], sink)
    return Machine(
        parsed.name,
        parsed.source,
        parsed.package,
        tick_hz,
        initial,
        tuple(instances),
        tuple(connections),
        tuple(states),
        tuple(requests),
        tuple(edges),
        tuple(channels),
        program,
        tuple(file.source for file in parsed.files),
        parsed.targets,
        "\n".join((parsed.hashed_text, *_used_constants(parsed), *reader.columns)),
        views,
        arm=arm,
        command_timeout_ns=command_timeout_ns,
        payload=payload,
        tree=parsed.joined.tree,
    )


def _check_ports(parsed: ParsedMachine, ports: PortResolver) -> bool:
    """Whether all `ports` exist. What connects a wrong one is not to blame, so the check ends with them."""
    before = ports.sink.errors
    for record, path in parsed.joined.ports:
        ports.port(path, (record,), f"one of `ports.{record}`")
    return ports.sink.errors == before


def _used_constants(parsed: ParsedMachine) -> list[str]:
    """The constants that values of the JSON and its parts read, for a hash."""
    parts = [(f"{file.part} ", scope.constants) for file, scope in parsed.joined.scopes.items()]
    return [f"{part}{text}" for part, own in [("", parsed.constants), *parts] if own for text in own.used_texts]


# ---- algorithms ----------------------------------------------------------------------------------------------------


def _modules(parsed: ParsedMachine, program: Program, reader: ConfigReader) -> Modules:
    classes: dict[str, set[str]] = {}
    for a in parsed.algorithms.values():
        if a.file is not None and not a.sizes:
            classes.setdefault(a.file.source.name, set()).add(a.class_name)
    return Modules(program, classes, reader.sink)


def _check_algorithms(parsed: ParsedMachine, modules: Modules, reader: ConfigReader) -> Algorithms:
    """All algorithms by name. None for one with an error reported here or while parsing."""
    found: Algorithms = {}
    for name, algorithm in parsed.algorithms.items():
        declarations = modules.load(algorithm.file) if algorithm.file is not None else None
        class_ = _class_of(algorithm, declarations, reader.sink) if declarations is not None else None
        if declarations is not None and class_ is not None and algorithm.sizes:
            class_ = _sized(algorithm, modules, declarations, reader.sink)
        if declarations is None or class_ is None or algorithm.file is None:
            found[name] = None
            continue
        files = tuple(file.source.name for file in algorithm.file.all)
        sizes = {size: value for size, (value, _) in algorithm.sizes.items()}
        sink = DiagnosticSink() if sizes else reader.sink
        table = modules.table(declarations).reporting_to(sink)
        checked = check_algorithm(name, class_, files, table, declarations.sound, sink, sizes)
        if sizes:
            _report_sized(sink, algorithm, reader.sink)
        if algorithm.parts:
            check_structs(algorithm, modules.program.structs, reader)
            check_listed(checked, algorithm.parts, reader)
        if algorithm.requests is not None:
            checked = bind_requests(checked, algorithm.requests, modules.program, reader.sink)
        found[name] = checked if declarations.declared else None
    return found


def _report_sized(found: DiagnosticSink, parsed: ParsedAlgorithm, sink: DiagnosticSink) -> None:
    """Reports what is wrong in a class with the sizes of its entry."""
    shown = ", ".join(f"{size} = {value}" for size, (value, _) in parsed.sizes.items())
    note = Note(next(span for _, span in parsed.sizes.values()), f"with {shown} here")
    for diagnostic in found.diagnostics:
        sink.extend([diagnostic], note if diagnostic.severity is Severity.ERROR else None)


def _class_of(parsed: ParsedAlgorithm, declarations: Declarations, sink: DiagnosticSink) -> AlgorithmClass | None:
    """The class that an entry of `algorithms` names. None after reporting that its file does not contain it."""
    name, classes = parsed.class_name, list(declarations.classes)
    if name in classes:
        return declarations.classes[name]
    if name not in declarations.wrong:
        one = f'add `"class": "{classes[0]}"`, or rename the entry to `{classes[0]}`' if len(classes) == 1 else ""
        fix = nearest(name, classes) or one or (f"it has {', '.join(classes)}" if classes else f"class {name}:")
        message = f"`{declarations.source.name}` has no class `{name}`"
        sink.error("E206", message, parsed.class_span, help=fix)
    return None


def _sized(
    parsed: ParsedAlgorithm, modules: Modules, declarations: Declarations, sink: DiagnosticSink
) -> AlgorithmClass | None:
    """The class that an entry of `algorithms` names, with the sizes that it binds. None after reporting other sizes."""
    name = parsed.class_name
    node = next(n for n in declarations.tree.body if isinstance(n, ast.ClassDef) and n.name == name)
    variables = size_variables(node, declarations.defined)
    for size, (_, span) in parsed.sizes.items():
        if size not in variables:
            fix = nearest(size, variables) or (f"it has {', '.join(variables)}" if variables else "it has none")
            sink.error("E206", f"`{name}` has no size `{size}`", span, help=fix)
    missing = [size for size in variables if size not in parsed.sizes]
    if missing:
        fix = f'add `"{missing[0]}": …` to `sizes`'
        sink.error("E202", f"`{parsed.written}` has no size `{missing[0]}`", parsed.span, help=fix)
    if missing or len(parsed.sizes) > len(variables):
        return None
    sizes = {size: value for size, (value, _) in parsed.sizes.items()}
    return modules.read_sized(declarations, node, sizes)


def _warn_unused(
    parsed: ParsedMachine,
    algorithms: Algorithms,
    instances: list[Instance],
    incomplete: set[str],
    sink: DiagnosticSink,
) -> None:
    used = {i.algorithm.name for i in instances}
    for name, algorithm in algorithms.items():
        if algorithm is not None and name not in used and not incomplete:
            entry = parsed.algorithms[name]
            sink.warning("W201", f"algorithm `{entry.written}` has no instance", entry.span, help="remove it")


# ---- instances -----------------------------------------------------------------------------------------------------


def _read_instances(
    node: JsonNode | None, algorithms: Algorithms | None, nan: str, reader: ConfigReader
) -> tuple[list[Instance], set[str]]:
    """Valid instances, and the names of invalid ones (uses of these are not reported again).

    `algorithms` is None if they could not be read. nan: of instances that do not say it.
    """
    instances: list[Instance] = []
    incomplete: set[str] = set() if node is not None and node.kind == "object" else Everything()
    for name, (definition, span) in reader.named(node, "`instances`", instances=bool(reader.scopes)).items():
        incomplete.add(name)
        if name in RESERVED_INSTANCES:
            reader.sink.error("E209", f"`{name}` is reserved", span, help="give the instance another name")
            continue
        optional = ("parameters", "inputs", "max_wcet_us", "frozen", "nan")
        shown = span.local(name)
        keys = reader.object(definition, f"instance `{shown}`", ("algorithm",), optional)
        if keys is None or "algorithm" not in keys or algorithms is None:
            continue
        named = keys["algorithm"]
        reported = [n for n, a in algorithms.items() if a is None]
        if named.kind == "string" and str(named.value) not in algorithms and misspelt(str(named.value), reported):
            continue  # the entry is misspelt; this was reported with its file
        index = reader.reference(named, "algorithm", list(algorithms))
        algorithm = list(algorithms.values())[index] if index is not None else None
        if algorithm is None:
            continue
        incomplete.discard(name)
        at = keys["parameters"].span if "parameters" in keys else definition.span
        parameters = _read_parameters(name, algorithm, keys, definition.span, reader)
        wcet = reader.integer(keys.get("max_wcet_us"), "max_wcet_us", 1, 1_000_000) or 0
        frozen = _read_frozen(algorithm, keys.get("frozen"), named.written, reader)
        execute, start = algorithm.execute, algorithm.start
        values = {n: parameters[n] for n in frozen if n in parameters}
        if values:
            freezer = Freezer(algorithm, name.replace(".", "__"), values)
            execute, start = freezer.function(execute), freezer.function(start) if start is not None else None
        if not check_loops(shown, (execute, start), frozen, values, at, reader.sink):
            incomplete.add(name)
            continue
        nan_fails = (reader.choice(keys.get("nan"), "`nan`", NAN) or nan) == "fail"
        if nan_fails:
            execute = with_finite_results(execute, algorithm)
            start = with_finite_results(start, algorithm) if start is not None else None
        instances.append(Instance(name, algorithm, parameters, {}, wcet, frozen, execute, start, span, True, nan_fails))
    return instances, incomplete


def _read_parameters(
    instance: str, algorithm: ir.Algorithm, keys: Mapping[str, JsonNode], definition: Span, reader: ConfigReader
) -> dict[str, Values]:
    ports = {p.name: p for p in algorithm.ports["parameters"]}
    values: dict[str, Values] = {}
    node, shown = keys.get("parameters"), definition.local(instance)
    at = node.span if node is not None else definition
    given = reader.named(node, f"`parameters` of `{shown}`")
    meant: set[str] = set()  # parameters that misspelt names probably stand for
    for name, (value_node, span) in given.items():
        port = ports.get(name)
        by_port = span.source != definition.source
        if port is None and (by_port or not algorithm.complete):
            continue  # a reported error may be the reason; a wrong port of a part is one
        if port is None:
            meant.add(misspelt(name, [p for p in ports if p not in given]))
            hint = nearest(name, list(ports)) or (f"it has {', '.join(ports)}" if ports else "it has none")
            message = f"algorithm `{keys['algorithm'].written}` has no parameter `{name}`"
            reader.sink.error("E210", message, span, help=hint)
            continue
        what = f"parameter `{_key(span) if by_port else name}`"
        value = reader.value(value_node, port.type, what, port.unit)
        if value is not None and _within(what, port, value_node, value, reader):
            values[name] = value
    for name, port in ports.items():
        if name not in given and port.default is not None:
            values[name] = port.default
            for word in port.default if element_of(port.type) is REQUEST else ():
                reader.use_request(str(word), port.span, instance)
    readable = algorithm.complete and (node is None or node.kind == "object")
    for name, port in ports.items() if readable else ():
        if name not in given and name not in meant and port.default is None:
            reader.sink.error(
                "E211",
                f"parameter `{name}` of `{shown}` has no value",
                at,
                help=f'add `"{name}": …` ({_declared(port)})',
                notes=[(port.span, "declared here")],
            )
    return values


def _key(span: Span) -> str:
    """The name that stands at a span of a key: that of a port, where a value of a part's field is given by it."""
    return span.text.strip('"')


def _declared(port: ir.Port) -> str:
    """Type, unit and range as declared in the algorithm."""
    bounds = "" if port.range == UNBOUNDED else f"in {port.range}"
    return " ".join(part for part in (str(port.type), port.unit, bounds) if part)


def _within(what: str, port: ir.Port, node: JsonNode, values: Values, reader: ConfigReader) -> bool:
    """Checks a value against the parameter's range. Returns False after reporting a value outside."""
    outside = next((v for v in values if v not in port.range), None) if port.range != UNBOUNDED else None
    if outside is not None:
        message = f"{what} is {outside}, outside {port.range}"
        notes = [(port.span, "its range is declared here")]
        reader.sink.error("E204", message, node.span, help="choose a value inside, or widen the range", notes=notes)
    return outside is None


def _read_publish(
    node: JsonNode | None, instances: list[Instance], incomplete: set[str], reader: ConfigReader
) -> list[Instance]:
    """Applies `publish` to the instances. Without `publish`, all instances are published."""
    if node is None:
        return instances
    names = [i.name for i in instances]
    listed: dict[str, Span] = {}
    for item in reader.list(node, "`publish`"):
        if item.kind == "string" and str(item.value) in incomplete:
            continue
        index = reader.reference(item, "instance", names)
        if index is None:
            continue
        first = listed.setdefault(names[index], item.span)
        if first is not item.span:
            message = f"`{names[index]}` is listed twice in `publish`"
            reader.sink.error("E235", message, item.span, help="remove one of the two", notes=[(first, "first here")])
    return [replace(i, published=i.name in listed) for i in instances]


def _signals(instances: list[Instance], incomplete: set[str]) -> Signals:
    """What `views` may name."""
    ports = {i.name: {f"{r}.{p.name}": p for r in ir.RECORDS for p in i.algorithm.ports[r]} for i in instances}
    wrong = {i.name for i in instances if not i.algorithm.complete}
    wrong |= {name for name, found in ports.items() if any(is_partial(p.type) for p in found.values())}
    known = {name: {path: (p.type, p.unit) for path, p in found.items()} for name, found in ports.items()}
    return Signals(known, incomplete if isinstance(incomplete, Everything) else incomplete | wrong)


def _read_frozen(algorithm: ir.Algorithm, node: JsonNode | None, written: str, reader: ConfigReader) -> tuple[str, ...]:
    """Parameters to freeze: `true` (all) or a list of names. The result is in the order of the ports. `written`: the name of
    the algorithm in its file."""
    names = [p.name for p in algorithm.ports["parameters"]]
    if node is None or (node.kind == "bool" and not node.value):
        return ()
    if node.kind == "bool":
        return tuple(names)
    if node.kind != "array":
        fix = 'write `true`, or name parameters: ["gain"]'
        reader.sink.error("E234", "`frozen` is true or a list of parameters", node.span, help=fix)
        return ()
    found: set[str] = set()
    for item in node.items:
        text = reader.string(item, "a frozen parameter")
        if text is not None and text not in names and algorithm.complete:
            hint = nearest(text, names) or (f"it has {', '.join(names)}" if names else "it has none")
            reader.sink.error("E234", f"algorithm `{written}` has no parameter `{text}`", item.span, help=hint)
        elif text in names:
            found.add(text)
    return tuple(n for n in names if n in found)


def _with_initial_inputs(
    node: JsonNode | None,
    instances: list[Instance],
    connections: list[Connection],
    reader: ConfigReader,
) -> list[Instance]:
    """Adds the initial values of host inputs. A connected input has none."""
    connected = {(c.target.instance, c.target.field): c for c in connections}
    out: list[Instance] = []
    for index, instance in enumerate(instances):
        definition = node.get(instance.name) if node else None
        shown = instance.span.local(instance.name)
        given = reader.named(definition.get("inputs") if definition else None, f"`inputs` of `{shown}`")
        values: dict[str, Values] = {}
        for name, (value_node, span) in given.items():
            port = instance.algorithm.port("inputs", name)
            key = _key(span) if span.source != instance.span.source else name
            if port is None and not instance.algorithm.complete:
                continue
            if port is None:
                hint = nearest(name, [p.name for p in instance.algorithm.ports["inputs"]])
                reader.sink.error("E210", f"`{shown}` has no input `{name}`", span, help=hint)
            elif (index, name) in connected:
                at = connected[index, name].span
                fix = "remove the initial value; a `delayed` connection has its own `initial`"
                reader.sink.error("E212", f"input `{key}` is connected", span, help=fix, notes=[(at, "here")])
            else:
                value = reader.value(value_node, port.type, f"input `{key}`", port.unit)
                if value is not None:
                    values[name] = value
        out.append(replace(instance, inputs=values))
    return out


# ---- connections ---------------------------------------------------------------------------------------------------


def _read_connections(node: JsonNode | None, ports: PortResolver, reader: ConfigReader) -> list[Connection]:
    connections: list[Connection] = []
    targets: dict[tuple[int, str], Span] = {}
    for item in reader.list(node, "`connections`"):
        keys = reader.object(item, "a connection", ("from", "to"), ("delayed", "initial"))
        if keys is None or "from" not in keys or "to" not in keys:
            continue
        delayed = reader.boolean(keys.get("delayed"), "`delayed`")
        if ports.swapped(keys["from"], keys["to"]):
            continue
        source = ports.source(keys["from"])
        target = ports.target(keys["to"])
        if target is not None:
            key = (target.instance, target.field)
            if key in targets:
                fix = "an input has one source; remove one connection"
                reader.sink.error(
                    "E213",
                    f"two sources for `{keys['to'].written}`",
                    keys["to"].span,
                    help=fix,
                    notes=[(targets[key], "first")],
                )
                continue
            targets[key] = keys["to"].span
        if source is None or target is None or not ports.compatible(source, target):
            continue
        if delayed is None and "delayed" in keys:
            continue
        initial = _initial(keys, delayed or False, source, item, reader)
        connections.append(Connection(source, target, delayed or False, initial, item.span))
    return connections


def _initial(keys: dict[str, JsonNode], delayed: bool, source: PortRef, item: JsonNode, reader: ConfigReader) -> Values:
    given = keys.get("initial")
    if not delayed:
        if given is not None:
            reader.sink.error(
                "E214", "`initial` without `delayed`", given.span, help='add `"delayed": true`, or remove it'
            )
        return ()
    if source.instance < 0:
        fix = "remove `delayed`"
        reader.sink.error("E214", f"`{source.record}` sources are never delayed", keys["delayed"].span, help=fix)
        return ()
    if given is None:
        fix = 'add `"initial": …`: the value of the input in the first tick'
        reader.sink.error("E214", "a `delayed` connection has no `initial`", item.span, help=fix)
        return ()
    value = reader.value(given, source.type, "`initial`", source.unit)
    return value or ()
