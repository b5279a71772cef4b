"""Compensation: margins before, after, and in flight."""

from dataclasses import dataclass
from typing import final

from delaytools.analysis.margins import Margins
from delaytools.design.design import Design
from delaytools.report.verdict import Verdict, judged

__all__ = ["Compensation", "compensations"]


@final
@dataclass(frozen=True)
class Compensation:
    """One compensated loop: changed values (path, was, is) and margins; judgement of `after` against flight."""

    name: str
    before_name: str
    changed: tuple[tuple[str, str, str], ...]
    before: Margins
    after: Margins
    flight: Margins | None

    @property
    def judgement(self) -> str:
        """As `verdict` judges a bench."""
        return judged(self.after, self.flight)[0]


def compensations(design: Design, answer: Verdict) -> tuple[Compensation, ...]:
    """The configurations that only move what [tuning] may vary: compensated forms of what they extend."""
    vary = {name if "." in name else f"parameters.{name}" for name in design.tables.tuning.vary}
    rows = {row.name: row for row in answer.rows}
    found = []
    for name, table in design.tables.configurations.items():
        moved = table.set and set(table.set) <= vary and not table.effects
        if not moved or table.extend not in rows or name not in rows:
            continue
        before, after = rows[str(table.extend)], rows[name]
        changed = tuple((path, _was(design, path), _short(new)) for path, new in table.set.items())
        found.append(
            Compensation(name, before.name, changed, before.bench, after.bench, before.flight or after.flight)
        )
    return tuple(found)


def _short(value: object) -> str:
    """A value as a table shows it."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _was(design: Design, path: str) -> str:
    home, _, name = path.partition(".")
    table = design.tables.parameters if home == "parameters" else design.data["blocks"].get(home, {})
    return str(table.get(name, "not given"))
