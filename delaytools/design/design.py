"""A design: the tables of a design file and its very text, so that what is not touched is written back as it was."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

from delaytools.design.faults import Faults
from delaytools.design.schema import DesignTable, check_shape
from delaytools.signals.trouble import DesignError

__all__ = ["Design", "parse_design"]


@final
@dataclass(frozen=True)
class Design:
    """The text of a design file and the name under which errors speak of it.

    Raises DesignError, naming every fault of its shape, when the tables are first read.
    """

    text: str
    name: str = "design"

    @cached_property
    def data(self) -> dict[str, Any]:
        """The file's tables as plain dictionaries."""
        try:
            return tomllib.loads(self.text)
        except tomllib.TOMLDecodeError as error:
            raise DesignError(
                f"not a TOML file: {error}", where=self.name, advice=_advice(self.text)
            ) from error

    @cached_property
    def tables(self) -> DesignTable:
        """The file's tables, checked for their shape."""
        tables, found = check_shape(self.data)
        faults = Faults(self.name)
        faults.found.extend(found)
        faults.settle()
        return tables

    @property
    def title(self) -> str:
        """The title, or the file's name where there is none."""
        return self.tables.title or self.name

    @property
    def configurations(self) -> Mapping[str, str]:
        """Names and descriptions of the configurations."""
        return {name: table.description for name, table in self.tables.configurations.items()}


def _advice(text: str) -> str:
    if not text.isprintable() and any(ord(mark) < 9 for mark in text):
        return "this is no text file: give a design file"
    return "mend the line named; text stands in quotes, tables begin with [NAME]"


def parse_design(text: str, name: str = "design") -> Design:
    """The design written as `text`; raises DesignError for what is not TOML or not a design."""
    design = Design(text, name)
    _ = design.tables
    return design
