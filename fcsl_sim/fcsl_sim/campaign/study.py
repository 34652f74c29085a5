# SPDX-License-Identifier: Apache-2.0
"""Reads a study, *.study.json: which simulation is flown, what is dispersed, what is measured, when a flight has passed."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from fcsl_compiler.api.diagnostics import DiagnosticSink, SourceFile, Span, nearest
from fcsl_compiler.api.files import SourceError
from fcsl_compiler.api.json_files import ConfigReader, JsonNode, SourcePathError, parse_json, resolve_source
from fcsl_compiler.api.types import Scalar, scalar_of, shape_of
from simclient.descriptor import Machine
from simclient.parameters import Given
from simclient.requirements import Verdict

from ..config import SimConfig, load
from ..controller_parameters import ControllerParameter, controller_parameters
from ..element_path import name_an_element, row_major_index, split_path
from ..errors import SimError
from ..models import ModelField
from ..plan import Target
from ..sim_run import SimRun
from .dispersion import (
    Choice,
    Design,
    Distribution,
    Grid,
    LatinHypercube,
    Normal,
    Random,
    Uniform,
    Value,
    cholesky,
    random_bits,
)
from .metric import RESERVED, Metric, MetricError
from .tune_block import Tune, read_tune

MAX_CASES = 10_000_000
#: Of the table, beside those of parameters and metrics.
OWN_COLUMNS = ("case", "seed", "verdict", "end", "ticks", "hash", "error", "failed_by")
#: Keys that say nothing about the flights.
_FOR_READERS = ("$schema", "description")
_DESIGNS = ("random", "latin_hypercube", "sweep", "corners")
#: Of all values of a normal distribution, those that `within` must leave: doubles below 1 tell no fewer apart.
_LEAST_SHARE = 1e-12
_SPREADS = ("uniform", "normal", "choice", "linear")
_EXAMPLE = '{"uniform": [0.5, 1.5]}'
_DEFAULT_TIMEOUT_S = 60.0


@dataclass(frozen=True)
class Dispersed:
    """A parameter or input of a model, a parameter of a controller, or an element of one: `instance.parameters.name[2]`.
    `target`: what is set; its first word is an instance of the plan or a controller."""

    path: str
    field: ModelField
    target: Target
    distribution: Distribution


@dataclass(frozen=True)
class Study:
    """`metrics` by name; `passes` is None where every flight that ends has passed. `required`: the requirements of the machine,
    by id, before a flight. `tune`: what `fcsl tune` does with it. `fingerprint` is of all that decides what the cases give."""

    path: Path
    config: SimConfig
    machine: Machine
    seed: int
    parameters: tuple[Dispersed, ...]
    design: Design
    metrics: dict[str, Metric]
    passes: Metric | None
    required: dict[str, Verdict]
    tune: Tune | None
    timeout_s: float
    fingerprint: str

    @property
    def cases(self) -> int:
        return self.design.count

    @property
    def columns(self) -> list[str]:
        """The numbers of a case: metrics, and for each requirement how often it was violated; NaN: not exercised."""
        return [*self.metrics, *(f"requirement.{id_}" for id_ in self.required)]

    @property
    def parameter_file(self) -> str:
        """That with which the controllers begin; empty: none."""
        given = self.config.plan.parameters
        return given.name if given else ""

    def seed_of(self, case: int) -> int:
        """Of the simulation's noise."""
        return random_bits(self.seed, case, "seed")

    def values(self, case: int) -> tuple[Value, ...]:
        """Of the parameters, in their order; those of a number are rounded to it."""
        return self.design.values(case)

    def repeat(self, case: int | None) -> str:
        """The command that flies a case again, recorded; empty without a case."""
        if case is None:
            return ""
        cases = f" --cases {self.cases}" if isinstance(self.design, Random | LatinHypercube) else ""
        given = f" --parameters {shlex.quote(self.parameter_file)}" if self.parameter_file else ""
        return f"fcsl campaign {shlex.quote(str(self.path))}{cases}{given} --case {case} --record case_{case}"

    def expressions(self) -> list[Metric]:
        return [*self.metrics.values(), *([self.passes] if self.passes else [])]

    def paths(self) -> set[str]:
        """The fields that metrics read."""
        return {path for metric in self.expressions() for path in metric.paths}

    def all_ticks(self) -> bool:
        return any(metric.all_ticks for metric in self.expressions())


def read_study(path: Path, cases: int | None = None, parameters: Given | None = None) -> Study:
    """Reads and checks the file; compiles models and machine. cases: in place of the file's. parameters: with which the
    controllers begin. Raises DiagnosticError with all errors of the file, or SimError."""
    try:
        source = SourceFile.read(path, str(path))
    except SourceError as error:
        raise SimError(f"{path}: {error}") from None
    sink = DiagnosticSink()
    root = parse_json(source, sink)
    sink.raise_if_failed()
    assert root is not None
    if root.kind == "object" and "models" in root.members:
        raise SimError(
            f"{path}: this is a simulation, not a study; `fcsl sim {path}` flies it; `fcsl schema study` has a study's keys"
        )
    return _Reader(path, sink, parameters).read(root, source.text, cases)


class _Reader:
    def __init__(self, path: Path, sink: DiagnosticSink, parameters: Given | None):
        self.path, self.sink, self.parameters = path, sink, parameters
        self.reader = ConfigReader(sink)

    def read(self, root: JsonNode, text: str, cases: int | None) -> Study:
        optional = (
            "cases",
            "parameters",
            "metrics",
            "pass",
            "duration",
            "timeout_s",
            "tune",
            "correlations",
            *_FOR_READERS,
        )
        keys = self.reader.object(root, "a study", ("simulation", "seed", "design"), optional)
        self.sink.raise_if_failed()
        assert keys is not None
        for key in _FOR_READERS:
            self.reader.string(keys.get(key), f"`{key}`")
        config = self._simulation(keys)
        seed = self.reader.integer(keys["seed"], "`seed`", 0, 2**64 - 1)
        parameters = self._parameters(keys.get("parameters"), config)
        design = self._design(keys, seed or 0, parameters, cases)
        timeout_s = self.reader.number(keys.get("timeout_s"), "`timeout_s`", 0.1, 1e6) or _DEFAULT_TIMEOUT_S
        run = SimRun(config)
        try:
            metrics = self._metrics(keys.get("metrics"), run.machine)
            passes = self._expression(keys.get("pass"), "`pass`", run.machine, metrics, condition=True)
            tune = self._tune(keys, config, parameters, metrics, run.machine)
            machine = run.machine
            required = {verdict.id: verdict for verdict in run.verdicts()}
        finally:
            run.close()
        self.sink.raise_if_failed()
        assert seed is not None and design is not None
        print_of = hashlib.sha256("\n".join([text, str(design.count), config.plan.text]).encode())
        print_of.update(config.plan.parameters.text if config.plan.parameters else b"")
        libraries = {config.library, *(table.library for table in config.tables.values())}
        libraries |= {companion.library for companion in config.companions.values()}
        for library in sorted(libraries):
            print_of.update(library.read_bytes())
        return Study(
            *(self.path, config, machine, seed, parameters, design, metrics, passes, required, tune, timeout_s),
            print_of.hexdigest(),
        )

    def _simulation(self, keys: dict[str, JsonNode]) -> SimConfig:
        node = keys["simulation"]
        text = self.reader.string(node, "`simulation`", "rover.sim.json")
        duration = self.reader.number(keys.get("duration"), "`duration`", 1e-9, 1e9)
        self.sink.raise_if_failed()
        assert text is not None
        try:
            file = resolve_source(text, config=self.path) if text.startswith("package://") else self.path.parent / text
        except SourcePathError as error:
            raise SimError(f"{text}: {error}") from None
        duration_s = None if duration is None else Fraction(repr(duration))
        return load(file, duration_s=duration_s, parameters=self.parameters)

    # ---- what is dispersed ------------------------------------------------------------------------------------------

    def _parameters(self, node: JsonNode | None, config: SimConfig) -> tuple[Dispersed, ...]:
        if node is None:
            return ()
        if node.kind != "object":
            self.reader.wrong(
                node, "`parameters` is an object from path to distribution", f'{{"plant.parameters.mass": {_EXAMPLE}}}'
            )
            return ()
        found = []
        settable = config.plan.targets()
        controllers = controller_parameters(config.machines)
        for path, member in node.members.items():
            whole, index = split_path(path)
            of_controller = controllers.get(whole)
            span = member.key_span
            if of_controller:
                field, owner = of_controller.shown, of_controller.target
                if not of_controller.is_settable(path, span, self.sink):
                    continue
            else:
                of_model = self._of_model(whole, span, config, controllers)
                if of_model is None:
                    continue
                field, owner = of_model
            place = self._place(whole, index, field, span)
            if place is None:
                continue
            target = *owner, str(place)
            if not of_controller and target not in settable:
                fix = f"give it one: in `{field.role}s` of `{owner[0]}`"
                self.sink.error("E211", f"`{path}` has no value in the simulation", span, help=fix)
                continue
            spread = self._distribution(member.value, path, scalar_of(field.type))
            if spread and (of_controller is None or self._in_range(spread, of_controller, path, member.value)):
                found.append(Dispersed(path, field, target, spread))
        return tuple(found)

    def _of_model(
        self, whole: str, span: Span, config: SimConfig, controllers: Iterable[str]
    ) -> tuple[ModelField, tuple[str, str]] | None:
        """The field, and the beginning of its target."""
        instance, _, rest = whole.partition(".")
        table = config.tables.get(instance)
        field = table.fields.get(rest) if table else None
        if field is None or field.role not in ("parameter", "input"):
            known = [f"{i}.{f.path}" for i, t in config.tables.items() for f in t.of_role("parameter", "input")]
            known += controllers
            fix = nearest(whole, known) or f"such as `{known[0]}`" if known else "the simulation has none"
            self.sink.error("E210", f"there is no parameter or input `{whole}`", span, help=fix)
            return None
        return field, (instance, field.path)

    def _place(self, whole: str, index: tuple[int, ...], field: ModelField, span: Span) -> int | None:
        """Number of the element."""
        shape = shape_of(field.type)
        place = row_major_index(index, shape)
        if place is None or len(index) < len(shape):
            what = f"`{whole}` is {field.type}; a study disperses scalars"
            self.sink.error("E217", what, span, help=name_an_element(whole, shape))
            return None
        return place

    def _in_range(self, spread: Distribution, of: ControllerParameter, path: str, node: JsonNode) -> bool:
        """Whether all values are in the range that the algorithm declares."""
        ends = spread.corners()
        if ends is None and of.field.bounded:
            why = f"the algorithm declares {of.range_text}, and a normal distribution has no bounds"
            self.sink.error("E214", f"`{path}` needs `within`", node.span, why=why, help='add `"within": [low, high]`')
            return False
        return ends is None or of.is_in_range(ends, path, node.span, self.sink)

    def _distribution(self, node: JsonNode, path: str, scalar: Scalar) -> Distribution | None:
        keys = self.reader.object(node, f"the distribution of `{path}`", (), (*_SPREADS, "within", "weights"))
        if keys is None:
            return None
        kinds = [kind for kind in _SPREADS if kind in keys]
        if len(kinds) != 1:
            message = f"the distribution of `{path}` has one of {', '.join(f'`{kind}`' for kind in _SPREADS)}"
            self.sink.error("E202", message, node.span, help=f"such as {_EXAMPLE}")
            return None
        (kind,) = kinds
        for extra, of in (("within", "normal"), ("weights", "choice")):
            if extra in keys and kind != of:
                self.sink.error("E214", f"`{extra}` is for `{of}`", keys[extra].span)
                return None
        if kind == "choice":
            return self._choice(keys, scalar)
        if not scalar.is_float:
            fix = 'write {"choice": […]}'
            self.sink.error("E217", f"`{path}` is {scalar.name}; `{kind}` gives floating numbers", node.span, help=fix)
            return None
        if kind == "linear":
            return self._linear(keys["linear"])
        if kind == "uniform":
            ends = self._pair(keys["uniform"], "`uniform` is a list of the least and the greatest value")
            return Uniform(*ends) if ends and self._ordered(ends, keys["uniform"]) else None
        return self._normal(keys)

    def _normal(self, keys: dict[str, JsonNode]) -> Distribution | None:
        pair = self._pair(keys["normal"], "`normal` is a list of mean and standard deviation")
        if pair is None:
            return None
        if pair[1] <= 0.0:
            self.sink.error("E204", f"a standard deviation of {pair[1]:g}", keys["normal"].span, help="it is positive")
            return None
        if "within" not in keys:
            return Normal(*pair, None)
        ends = self._pair(keys["within"], "`within` is a list of the least and the greatest value")
        if not ends or not self._ordered(ends, keys["within"]):
            return None
        normal = Normal(*pair, ends)
        low, high = normal.shares()
        if high - low < _LEAST_SHARE:
            why = f"mean {pair[0]:g}, standard deviation {pair[1]:g}: too few values would lie there to draw any"
            self.sink.error("E204", "`within` is far from the mean", keys["within"].span, why=why, help="use `uniform`")
            return None
        return normal

    def _choice(self, keys: dict[str, JsonNode], scalar: Scalar) -> Distribution | None:
        items = self.reader.list(keys["choice"], "`choice`")
        values = [self.reader.value(item, scalar, "a choice") for item in items]
        if not items and keys["choice"].kind == "array":
            self.sink.error("E204", "`choice` is empty", keys["choice"].span)
        if not items or any(value is None for value in values):
            return None
        plain = tuple(value[0] for value in values if value is not None and not isinstance(value[0], str))
        weights = [
            self.reader.number(item, "a weight", 0.0, 1e300)
            for item in self.reader.list(keys.get("weights"), "`weights`")
        ]
        if "weights" not in keys:
            return Choice(plain, (1.0,) * len(plain))
        given = tuple(weight for weight in weights if weight is not None)
        if len(given) != len(plain) or not sum(given) > 0.0:
            message = f"{len(plain)} choices have {len(plain)} weights, and not all are 0"
            self.sink.error("E204", message, keys["weights"].span)
            return None
        return Choice(plain, given)

    def _linear(self, node: JsonNode) -> Distribution | None:
        items = self.reader.list(node, "`linear`")
        if len(items) != 3:
            self.sink.error("E207", "`linear` is a list of first value, last value and count", node.span)
            return None
        first, last = (self.reader.number(item, "`linear`", -1e300, 1e300) for item in items[:2])
        count = self.reader.integer(items[2], "the count of `linear`", 2, MAX_CASES)
        if first is None or last is None or count is None:
            return None
        steps = count - 1
        values = tuple(first + (last - first) * i / steps if i < steps else last for i in range(count))
        return Choice(values, (1.0,) * count)

    def _pair(self, node: JsonNode, rule: str) -> tuple[float, float] | None:
        items = self.reader.list(node, rule.partition(" ")[0])
        numbers = [self.reader.number(item, "a bound", -1e300, 1e300) for item in items]
        if len(items) != 2:
            if node.kind == "array":
                self.sink.error("E207", rule, node.span, help="write […, …]")
            return None
        if numbers[0] is None or numbers[1] is None:
            return None
        return numbers[0], numbers[1]

    def _ordered(self, ends: tuple[float, float], node: JsonNode) -> bool:
        if ends[0] < ends[1]:
            return True
        self.sink.error("E204", f"{ends[0]:g} is not below {ends[1]:g}", node.span)
        return False

    # ---- which cases ------------------------------------------------------------------------------------------------

    def _design(
        self, keys: dict[str, JsonNode], seed: int, parameters: Sequence[Dispersed], given: int | None
    ) -> Design | None:
        name = self.reader.choice(keys["design"], "`design`", _DESIGNS)
        count = self.reader.integer(keys.get("cases"), "`cases`", 1, MAX_CASES)
        if name is None or ("cases" in keys and count is None):
            return None
        paths, spreads = [p.path for p in parameters], [p.distribution for p in parameters]
        if name != "random" and "correlations" in keys:
            fix = "use `random`"
            self.sink.error("E214", f"a design `{name}` has no correlations", keys["correlations"].span, help=fix)
        if name in ("random", "latin_hypercube"):
            if "cases" not in keys:
                self.sink.error(
                    "E202", f"a design `{name}` has no `cases`", keys["design"].span, help='add `"cases": 100`'
                )
                return None
            if name == "latin_hypercube":
                return LatinHypercube(seed, paths, spreads, given or count or 1)
            return Random(seed, paths, spreads, given or count or 1, self._correlations(keys, paths))
        if "cases" in keys or given is not None:
            place = keys["cases"].span if "cases" in keys else keys["design"].span
            self.sink.error(
                "E214", f"the parameters say how many cases a design `{name}` has", place, help="remove `cases`"
            )
            return None
        return self._grid(name, keys["design"].span, parameters)

    def _correlations(self, keys: dict[str, JsonNode], paths: Sequence[str]) -> Sequence[Sequence[float]]:
        """The lower triangle of the matrix; empty without correlations, or after reporting errors."""
        matrix = [[float(i == j) for j in range(len(paths))] for i in range(len(paths))]
        for item in self.reader.list(keys.get("correlations"), "`correlations`"):
            pair = self.reader.object(item, "a correlation", ("of", "is"))
            if pair is None or len(pair) < 2:
                continue
            named = self.reader.list(pair["of"], "`of`")
            places = [self.reader.reference(one, "dispersed parameter", paths) for one in named]
            value = self.reader.number(pair["is"], "`is`", -1.0, 1.0)
            if pair["of"].kind == "array" and (len(places) != 2 or (None not in places and places[0] == places[1])):
                self.sink.error(
                    "E207", "`of` is a list of two different parameters", pair["of"].span, help="write […, …]"
                )
            elif len(places) == 2 and places[0] is not None and places[1] is not None and value is not None:
                if matrix[places[0]][places[1]] != 0.0:
                    self.sink.error("E213", "this pair has a correlation already", pair["of"].span)
                matrix[places[0]][places[1]] = matrix[places[1]][places[0]] = value
        factor = cholesky(matrix)
        if factor is None:
            why = "together they contradict each other, or one value follows from others"
            span = keys["correlations"].span
            self.sink.error("E204", "the correlations are not positive definite", span, why=why, help="weaken them")
        return factor if factor and "correlations" in keys else ()

    def _grid(self, name: str, span: Span, parameters: Sequence[Dispersed]) -> Design | None:
        levels = []
        for p in parameters:
            found = p.distribution.levels() if name == "sweep" else p.distribution.corners()
            if found is None:
                need = "`choice` or `linear`" if name == "sweep" else "bounds: `within`"
                self.sink.error("E214", f"a design `{name}` needs {need} for `{p.path}`", span)
                return None
            levels.append(found)
        grid = Grid(levels)
        if grid.count > MAX_CASES:
            self.sink.error("E204", f"{grid.count} cases", span, help=f"there are at most {MAX_CASES}")
            return None
        return grid

    # ---- what is measured -------------------------------------------------------------------------------------------

    def _metrics(self, node: JsonNode | None, machine: Machine) -> dict[str, Metric]:
        found: dict[str, Metric] = {}
        for name, (definition, span) in self.reader.named(node, "`metrics`").items():
            if name in OWN_COLUMNS or name in RESERVED:
                what = "a column of every table" if name in OWN_COLUMNS else "a function"
                self.sink.error("E209", f"`{name}` is {what}", span, help="give the metric another name")
            metric = self._expression(definition, f"metric `{name}`", machine, found)
            if metric is not None:
                found[name] = metric
        return found

    def _tune(
        self,
        keys: dict[str, JsonNode],
        config: SimConfig,
        parameters: Sequence[Dispersed],
        metrics: Mapping[str, Metric],
        machine: Machine,
    ) -> Tune | None:
        if "tune" not in keys:
            return None
        given = keys.get("cases")
        cases = int(given.value) if given and given.kind == "int" and isinstance(given.value, int) else None
        controllers = controller_parameters(config.machines)
        dispersed = {p.path: p.target for p in parameters}
        return read_tune(keys["tune"], self.reader, controllers, dispersed, metrics, machine, cases)

    def _expression(
        self, node: JsonNode | None, what: str, machine: Machine, metrics: Mapping[str, Metric], condition: bool = False
    ) -> Metric | None:
        text = self.reader.string(node, what, "max(body.outputs.speed)")
        if text is None or node is None:
            return None
        try:
            return Metric(text, machine, metrics, condition)
        except MetricError as error:
            self.sink.error("E208", f"{what}: {error}", node.span)
            return None
