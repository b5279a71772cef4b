"""Which cell each block stands in: the way round through the opened signal folded over two rows, the rest below."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

from delaytools.report.diagram_parts import Part
from delaytools.report.signal_graph import longest_cycle, on_cycles, strays

__all__ = ["Cell", "Grid", "grid_of"]

MOST = 6  # columns


@final
@dataclass(frozen=True)
class Cell:
    """row 0 on top; forward: signals run left to right through the box, else right to left."""

    row: int
    column: int
    forward: bool


@final
@dataclass(frozen=True)
class Grid:
    """Cells by name of block, and the size of the grid."""

    cells: Mapping[str, Cell]
    rows: int
    columns: int


def grid_of(parts: tuple[Part, ...], at: str) -> Grid:
    """The grid of the parts; `at`: the opened signal, whose loop is laid out first."""
    graph = _graph(parts)
    left, cells, rows = [part.name for part in parts], dict[str, Cell](), 0
    start = next((part.name for part in parts if at in part.outputs), None)
    while left:
        chain, closed = _next_chain(graph, start if start in left else None, left)
        if cells and len(chain) == 1:
            cells[chain[0]] = _beside(chain[0], graph, cells, rows)
            rows = max(rows, cells[chain[0]].row + 1)
        else:
            chain = _turned_to_demand(chain, parts) if closed else chain
            rows = _fold(chain, cells, rows, closed=closed)
        left = [name for name in left if name not in cells]
    columns = 1 + max((cell.column for cell in cells.values()), default=0)
    return Grid(cells, rows, columns)


def _graph(parts: tuple[Part, ...]) -> dict[str, tuple[str, ...]]:
    return {
        part.name: tuple(
            other.name for other in parts if {e.signal for e in other.entries} & set(part.outputs)
        )
        for part in parts
    }


def _next_chain(
    graph: Mapping[str, tuple[str, ...]], start: str | None, left: list[str]
) -> tuple[tuple[str, ...], bool]:
    """(blocks in the order of their signal, whether it closes): the longest loop, else the longest chain."""
    inner = {name: tuple(r for r in graph[name] if r in left) for name in left}
    begins = [start] if start else [name for name in left if on_cycles(inner, name)]
    for name in begins:
        found = longest_cycle(inner, name)
        if found:
            return found, True
    chains = [strays(inner, name, set(left)) for name in ([start] if start else left)]
    return max(chains, key=len), False


def _turned_to_demand(chain: tuple[str, ...], parts: tuple[Part, ...]) -> tuple[str, ...]:
    """The loop begun at the block where several signals are compared, one of them from outside; else as it is."""
    written = {signal for part in parts for signal in part.outputs}
    by_name = {part.name: part for part in parts}

    def rank(name: str) -> tuple[int, int]:
        entries = by_name[name].entries
        outside = sum(e.signal not in written for e in entries)
        mixed = len({e.sign for e in entries}) > 1
        return int(outside > 0 and mixed), len(entries) if outside else 0

    best = max(range(len(chain)), key=lambda i: rank(chain[i]))
    return chain[best:] + chain[:best] if rank(chain[best])[1] else chain


def _fold(chain: tuple[str, ...], cells: dict[str, Cell], row: int, *, closed: bool) -> int:
    """Puts a chain into rows from `row` on, back and forth; returns the next free row."""
    columns = len(chain)
    if closed and len(chain) > 3:
        columns = (len(chain) + 1) // 2
    columns = min(columns, MOST)
    forward, column = True, 0
    for name in chain:
        if column in (columns, -1):
            row, forward = row + 1, not forward
            column = 0 if forward else columns - 1
        cells[name] = Cell(row, column, forward)
        column += 1 if forward else -1
    return row + 1


def _beside(name: str, graph: Mapping[str, tuple[str, ...]], cells: Mapping[str, Cell], rows: int) -> Cell:
    """A single block: in the column between what it reads and what reads it, in the lowest row or a new one."""
    into = [cells[n] for n, readers in graph.items() if name in readers and n in cells]
    out = [cells[n] for n in graph[name] if n in cells]
    near = [cell.column for cell in (*into, *out)]
    column = round(sum(near) / len(near)) if near else 0
    forward = not (into and out) or min(c.column for c in out) > max(c.column for c in into)
    taken = {(cell.row, cell.column) for cell in cells.values()}
    first = 1 + max((cell.row for cell in (*into, *out)), default=rows - 1)
    row = next(r for r in range(first, rows + 1) if (r, column) not in taken)
    return Cell(row, column, forward)
