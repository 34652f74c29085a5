# SPDX-License-Identifier: Apache-2.0
"""Lays out a picture: boxes in layers from left to right, with orthogonal wires between them.

The method is Sugiyama's: remove cycles, assign layers by longest path, order layers by barycentres, assign coordinates.
Every coordinate of a row lies on a grid of ROW; odd layers are offset by half of it. Wires that leave one layer and
wires that enter the next are therefore never on one line. Wires of different sources cross at right angles or not at
all.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from dataclasses import dataclass, field

from .model import Box, Picture, Wire

ROW = 20
TRACK = 10  # distance between vertical wires
STUB = 14  # distance between a tag and its box, and between the last vertical wire and its target
CHAR = 7.5  # width of a character of 12 px
SMALL = 6.3  # width of a character of 10 px
PAD = 8
MARGIN = 10
CAPTION = 30
_SWEEPS = 12

Point = tuple[float, float]


@dataclass
class Placed:
    """A box with its position. Also a bend: a wire that passes through a layer."""

    box: Box | None
    layer: int
    width: float
    rows: int  # height in units of ROW, header included
    x: float = 0.0
    y: float = 0.0
    tag_width: float = 0.0

    @property
    def height(self) -> float:
        return self.rows * ROW

    def row_y(self, row: int) -> float:
        """Middle of a row."""
        return self.y + (header_rows(self.box) + row + 0.5) * ROW


@dataclass
class Layout:
    picture: Picture
    boxes: list[Placed]
    paths: list[list[Point]]  # one per wire
    dots: list[tuple[Point, int]]  # branch points of wires, each with one of its wires
    width: float
    height: float


@dataclass
class _Net:
    """The wires of one source row and one style. In each gap they share one vertical wire with pins at these
    heights."""

    wires: list[int]
    source: tuple[int, int]
    bends: dict[int, int] = field(default_factory=dict)  # layer → placed bend
    lane: int = -1  # lane of the way back to an earlier layer


def header_rows(box: Box | None) -> int:
    """Lines of the header: instances have a name and one or two lines below it, states a name."""
    if box is None or box.kind in ("channel", "transition", "any"):
        return 0
    return 2 + bool(box.calls) if box.kind == "instance" else 1


def box_width(box: Box) -> float:
    """Width of the longest line."""
    widths = [len(box.title) * CHAR, len(box.subtitle) * SMALL, len(box.calls) * SMALL]
    for row in box.rows:
        left = len(row.left) * CHAR + (len(row.left_note) + 1) * SMALL * bool(row.left_note)
        right = len(row.right) * CHAR + (len(row.right_note) + 1) * SMALL * bool(row.right_note)
        widths.append(left + right + (16 if left and right else 0))
    return round(max(widths) + 2 * PAD)


def tag_width(tag: str) -> float:
    return round(len(tag) * SMALL + 12)


def lay_out(picture: Picture) -> Layout:
    """Coordinates of all boxes and wires. Deterministic."""
    return _Layouter(picture).run()


class _Layouter:
    def __init__(self, picture: Picture):
        self.picture = picture
        self.placed: list[Placed] = []
        self.nets: list[_Net] = []
        self.layers: list[list[int]] = []
        #: Links (left, its pin below the top, right, its pin) between adjacent layers. And by box: (other, its pin, own
        #: pin).
        self.links: list[tuple[int, float, int, float]] = []
        self.before: list[list[tuple[int, float, float]]] = []
        self.after: list[list[tuple[int, float, float]]] = []
        self.gap_tracks: dict[int, int] = {}  # number of vertical wires to the left of a layer
        self.gap_x: dict[int, float] = {}  # position of the first of them

    def run(self) -> Layout:
        layers = assign_layers(len(self.picture.boxes), self.picture.wires)
        for box, layer in zip(self.picture.boxes, layers, strict=True):
            placed = Placed(box, layer, box_width(box), header_rows(box) + len(box.rows))
            placed.tag_width = max((tag_width(r.tag) + STUB for r in box.rows if r.tag), default=0.0)
            self.placed.append(placed)
        self._collect_nets()
        self._collect_links()
        count = max(layers, default=0) + 1
        self.layers = [[n for n, p in enumerate(self.placed) if p.layer == k] for k in range(count)]
        self._order()
        self._place_rows()
        lanes = self._assign_lanes()
        tracks = self._assign_tracks()
        width = self._place_columns(tracks)
        bottom = max((p.y + p.height for p in self.placed), default=0.0)
        by_wire: list[list[Point]] = [[] for _ in self.picture.wires]
        for n, net in enumerate(self.nets):
            for wire in net.wires:
                by_wire[wire] = self._path(n, wire, tracks, bottom)
        height = bottom + (lanes + 1) * TRACK * (lanes > 0) + MARGIN
        boxes = [p for p in self.placed if p.box is not None]
        return Layout(self.picture, boxes, by_wire, self._dots(by_wire), width, height)

    # ---- nets ------------------------------------------------------------------------------------------------------

    def _collect_nets(self) -> None:
        """Groups the wires of one source and style. Adds a bend for every layer that they pass."""
        nets: dict[tuple[int, int, bool], _Net] = {}
        for number, wire in enumerate(self.picture.wires):
            key = (wire.source, wire.source_row, wire.dashed)
            nets.setdefault(key, _Net([], key[:2])).wires.append(number)
        self.nets = list(nets.values())
        for net in self.nets:
            first = self.placed[net.source[0]].layer
            last = max(self.placed[self.picture.wires[w].target].layer for w in net.wires)
            for layer in range(first + 1, last):
                net.bends[layer] = len(self.placed)
                self.placed.append(Placed(None, layer, 0.0, 1))

    def _collect_links(self) -> None:
        for net in self.nets:
            at, row = net.source
            here = (at, (header_rows(self.placed[at].box) + row + 0.5) * ROW)
            stops: dict[int, tuple[int, float]] = {self.placed[at].layer: here}
            for layer, bend in sorted(net.bends.items()):
                left = stops[layer - 1]
                stops[layer] = (bend, 0.5 * ROW)
                self.links.append((*left, *stops[layer]))
            for number in net.wires:
                wire = self.picture.wires[number]
                target = self.placed[wire.target]
                if target.layer - 1 in stops:
                    offset = (header_rows(target.box) + wire.target_row + 0.5) * ROW
                    self.links.append((*stops[target.layer - 1], wire.target, offset))
        self.before = [[] for _ in self.placed]
        self.after = [[] for _ in self.placed]
        for a, oa, b, ob in self.links:
            self.after[a].append((b, ob, oa))
            self.before[b].append((a, oa, ob))

    # ---- order and height ------------------------------------------------------------------------------------------

    def _order(self) -> None:
        """Orders layers by barycentres, alternating forwards and backwards. Keeps the order with the fewest
        crossings."""
        best, fewest = [list(layer) for layer in self.layers], self._crossings()
        rank = {n: i for layer in self.layers for i, n in enumerate(layer)}
        for sweep in range(_SWEEPS):
            forward = sweep % 2 == 0
            for k in range(len(self.layers)) if forward else range(len(self.layers) - 1, -1, -1):
                centre: dict[int, float] = {}
                for n in self.layers[k]:
                    near = [rank[o] + offset / 1e4 for o, offset, _ in (self.before if forward else self.after)[n]]
                    centre[n] = sum(near) / len(near) if near else float(rank[n])
                self.layers[k].sort(key=centre.__getitem__)
                rank.update((n, i) for i, n in enumerate(self.layers[k]))
            count = self._crossings()
            if count < fewest:
                best, fewest = [list(layer) for layer in self.layers], count
        self.layers = best

    def _crossings(self) -> int:
        """Number of pairs of links between two layers whose ends are in opposite order."""
        rank = {n: i for layer in self.layers for i, n in enumerate(layer)}
        between: dict[int, list[tuple[float, float]]] = {}
        for a, oa, b, ob in self.links:
            between.setdefault(self.placed[a].layer, []).append((rank[a] * 1e4 + oa, rank[b] * 1e4 + ob))
        count = 0
        for pins in between.values():
            ends: list[float] = []
            for _, right in sorted(pins):
                count += len(ends) - bisect_right(ends, right)
                insort(ends, right)
        return count

    def _place_rows(self) -> None:
        """Assigns heights: as close to the middle of the neighbours as the order and one free row between boxes
        allow."""
        for layer in self.layers:
            y = 0.0
            for n in layer:
                self.placed[n].y = y
                y += self.placed[n].height + ROW
        for sweep in range(_SWEEPS):
            layers = self.layers if sweep % 2 == 0 else self.layers[::-1]
            for layer in layers:
                wanted = []
                for n in layer:
                    near = [self.placed[o].y + theirs - own for o, theirs, own in self.before[n] + self.after[n]]
                    wanted.append(sum(near) / len(near) if near else self.placed[n].y)
                for n, y in zip(layer, self._spread(layer, wanted), strict=True):
                    self.placed[n].y = y
        top = min((p.y for p in self.placed), default=0.0)
        for k, layer in enumerate(self.layers):
            below = -1e9
            for n in layer:
                p = self.placed[n]
                p.y = max(round((p.y - top) / ROW) * ROW, below) + 0.0
                below = p.y + p.height + self._space(n)
            for n in layer:
                self.placed[n].y += MARGIN + CAPTION + (k % 2) * ROW / 2

    def _space(self, n: int) -> float:
        return ROW if self.placed[n].box is not None else 0.0

    def _spread(self, layer: list[int], wanted: list[float]) -> list[float]:
        """Least squares with a fixed order (pool adjacent violators)."""
        offsets, y = [], 0.0
        for n in layer:
            offsets.append(y)
            y += self.placed[n].height + self._space(n)
        blocks: list[tuple[float, int]] = []
        for want, offset in zip(wanted, offsets, strict=True):
            mean, size = want - offset, 1
            while blocks and blocks[-1][0] > mean:
                before, count = blocks.pop()
                mean, size = (before * count + mean * size) / (count + size), count + size
            blocks.append((mean, size))
        means = [mean for mean, size in blocks for _ in range(size)]
        return [mean + offset for mean, offset in zip(means, offsets, strict=True)]

    # ---- columns ---------------------------------------------------------------------------------------------------

    def _assign_lanes(self) -> int:
        """Assigns a lane below all boxes to every net that leads back."""
        count = 0
        for net in self.nets:
            if any(not self._forward(net, w) for w in net.wires):
                net.lane = count
                count += 1
        return count

    def _forward(self, net: _Net, wire: int) -> bool:
        target = self.placed[self.picture.wires[wire].target]
        return target.layer > self.placed[net.source[0]].layer

    def _pins(self, net: _Net) -> dict[int, tuple[list[float], list[float], bool]]:
        """For each gap (the space to the left of a layer): heights of pins on its left and right, and whether the net
        goes down to its lane."""
        pins: dict[int, tuple[list[float], list[float], bool]] = {}
        source = self.placed[net.source[0]]
        heights = {source.layer: source.row_y(net.source[1])}
        heights |= {layer: self.placed[b].row_y(0) for layer, b in net.bends.items()}
        for layer, y in heights.items():
            rights = [self.placed[net.bends[layer + 1]].row_y(0)] if layer + 1 in net.bends else []
            for w in net.wires:
                wire = self.picture.wires[w]
                if self._forward(net, w) and self.placed[wire.target].layer == layer + 1:
                    rights.append(self.placed[wire.target].row_y(wire.target_row))
            dives = net.lane >= 0 and layer == source.layer
            pins[layer + 1] = ([y], rights, dives)
        return pins

    def _rises(self, net: _Net) -> dict[int, list[float]]:
        """For each gap: heights of the earlier boxes that a net enters from its lane."""
        rises: dict[int, list[float]] = {}
        for w in net.wires:
            wire = self.picture.wires[w]
            if not self._forward(net, w):
                target = self.placed[wire.target]
                rises.setdefault(target.layer, []).append(target.row_y(wire.target_row))
        return rises

    def _assign_tracks(self) -> dict[tuple[int, int, bool], int]:
        """(net, gap, rising) → number of its vertical wire in the gap, from the left."""
        below = max((p.y + p.height for p in self.placed), default=0.0)
        gaps: dict[int, list[tuple[tuple[int, int, bool], list[float], list[float]]]] = {}
        for n, net in enumerate(self.nets):
            lane = below + (net.lane + 1) * TRACK
            for gap, (left, right, dives) in self._pins(net).items():
                gaps.setdefault(gap, []).append(((n, gap, False), left + [lane] * dives, right))
            for gap, right in self._rises(net).items():
                gaps.setdefault(gap, []).append(((n, gap, True), [lane], right))
        tracks: dict[tuple[int, int, bool], int] = {}
        for group in gaps.values():
            for number, (key, _, _) in enumerate(_few_crossings(group)):
                tracks[key] = number
        self.gap_tracks = {gap: len(group) for gap, group in gaps.items()}
        return tracks

    def _place_columns(self, tracks: dict[tuple[int, int, bool], int]) -> float:
        x = float(MARGIN)
        for k, layer in enumerate([*self.layers, []]):
            count = self.gap_tracks.get(k, 0)
            if count:
                x += TRACK
                self.gap_x[k] = x
                x += (count - 1) * TRACK
                x += STUB
            x += max((self.placed[n].tag_width for n in layer), default=0.0)
            for n in layer:
                self.placed[n].x = x
            width = max((self.placed[n].width for n in layer), default=0.0)
            for n in layer:
                box = self.placed[n].box
                if box is None or box.kind == "instance":
                    self.placed[n].width = width
            x += width
        return x + MARGIN

    # ---- paths -----------------------------------------------------------------------------------------------------

    def _path(self, n: int, number: int, tracks: dict[tuple[int, int, bool], int], bottom: float) -> list[Point]:
        wire, net = self.picture.wires[number], self.nets[n]
        source, target = self.placed[wire.source], self.placed[wire.target]

        def track(gap: int, rising: bool = False) -> float:
            return self.gap_x[gap] + tracks[n, gap, rising] * TRACK

        y = source.row_y(wire.source_row)
        end = (target.x, target.row_y(wire.target_row))
        points = [(source.x + source.width, y)]
        if not self._forward(net, number):
            lane = bottom + (net.lane + 1) * TRACK
            down, up = track(source.layer + 1), track(target.layer, True)
            return [*points, (down, y), (down, lane), (up, lane), (up, end[1]), end]
        for layer in range(source.layer + 1, target.layer + 1):
            x = track(layer)
            next_y = end[1] if layer == target.layer else self.placed[net.bends[layer]].row_y(0)
            points += [(x, y), (x, next_y)]
            y = next_y
        return [*points, end]

    def _dots(self, paths: list[list[Point]]) -> list[tuple[Point, int]]:
        """Branch points of a net: a point of a vertical wire other than its ends, or one where three wires meet."""
        dots: list[tuple[Point, int]] = []
        for net in self.nets:
            ways: dict[Point, set[tuple[int, int]]] = {}
            verticals: dict[float, list[float]] = {}
            for w in net.wires:
                path = paths[w]
                for (ax, ay), (bx, by) in zip(path, path[1:], strict=False):
                    if ax == bx:
                        verticals.setdefault(ax, []).extend((ay, by))
                    elif len(path) > 2:
                        for x, y, to in ((ax, ay, bx), (bx, by, ax)):
                            ways.setdefault((x, y), set()).add((1 if to > x else -1, 0))
            for (x, y), found in ways.items():
                heights = verticals.get(x, [])
                if heights:
                    ends = (min(heights) < y) + (max(heights) > y)
                    if ends + len(found) > 2:
                        dots.append(((x, y), net.wires[0]))
        return sorted(dots)


def assign_layers(count: int, wires: list[Wire]) -> list[int]:
    """Layers by longest path from the left, ignoring dashed wires and wires that close a cycle."""
    after: list[list[int]] = [[] for _ in range(count)]
    for wire in wires:
        if not wire.dashed and wire.source != wire.target:
            after[wire.source].append(wire.target)
    state, order = [0] * count, []
    kept: list[list[int]] = [[] for _ in range(count)]
    for root in range(count):
        stack: list[tuple[int, int]] = [(root, 0)] if not state[root] else []
        while stack:
            node, child = stack.pop()
            state[node] = 1
            if child < len(after[node]):
                stack.append((node, child + 1))
                to = after[node][child]
                if state[to] != 1:
                    kept[node].append(to)
                if state[to] == 0:
                    stack.append((to, 0))
            else:
                state[node] = 2
                order.append(node)
    layers = [0] * count
    for node in reversed(order):
        for to in kept[node]:
            layers[to] = max(layers[to], layers[node] + 1)
    # A box without inputs is placed directly before its targets, not at the far left.
    entered = {to for targets in kept for to in targets}
    for node in order:
        if node not in entered and kept[node]:
            layers[node] = min(layers[to] for to in kept[node]) - 1
    return layers


_Vertical = tuple[tuple[int, int, bool], list[float], list[float]]


def _few_crossings(group: list[_Vertical]) -> list[_Vertical]:
    """Orders the vertical wires of a gap by swapping neighbours as long as a swap removes a crossing."""
    order = sorted(group, key=lambda v: (min(v[1] + v[2]), v[0]))
    improved = True
    while improved:
        improved = False
        for i in range(len(order) - 1):
            if _crossed(order[i + 1], order[i]) < _crossed(order[i], order[i + 1]):
                order[i], order[i + 1] = order[i + 1], order[i]
                improved = True
    return order


def _crossed(first: _Vertical, second: _Vertical) -> int:
    """Number of crossings of two vertical wires if `first` is to the left of `second`."""
    low, high = min(first[1] + first[2]), max(first[1] + first[2])
    low2, high2 = min(second[1] + second[2]), max(second[1] + second[2])
    return sum(low < y < high for y in second[1]) + sum(low2 < y < high2 for y in first[2])
