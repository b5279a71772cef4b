"""Contents → page: the sections in their order, under the title and the facts of the design."""

from importlib.metadata import PackageNotFoundError, version

from delaytools.report.contents import Contents
from delaytools.report.page import Page
from delaytools.report.sections_budget import budget_section
from delaytools.report.sections_compensation import compensation_section
from delaytools.report.sections_cycles import cycles_section
from delaytools.report.sections_delay import nyquist_section, sweep_section
from delaytools.report.sections_margins import tone, verdict_section
from delaytools.report.sections_measured import measured_section
from delaytools.report.sections_missing import missing_section
from delaytools.report.sections_rest import (
    assumptions_section,
    diagram_section,
    limits_section,
    locus_section,
    runs_section,
)

__all__ = ["page_of"]

_ORDER = (
    verdict_section, diagram_section, budget_section, sweep_section, nyquist_section, locus_section, cycles_section,
    runs_section, compensation_section, measured_section, missing_section, assumptions_section, limits_section,
)  # fmt: skip
_BY_LOGS = (measured_section, missing_section)


def page_of(contents: Contents) -> Page:
    """The page of a design's answers."""
    design = contents.design
    name = design.name.replace("\\", "/").rpartition("/")[2]
    facts = (
        ("Design", name),
        ("Configurations", str(len(contents.cases))),
        ("Opened at", contents.asked.at or "–"),
        ("Extra delay at", contents.asked.place or "–"),
        ("Seed", str(design.tables.simulation.seed)),
        ("delaytools", _version()),
    )
    sections = tuple(section(contents) for section in _ORDER if contents.evidence or section not in _BY_LOGS)
    return Page(design.title, facts, tone(contents), sections)


def _version() -> str:
    try:
        return version("delaytools")
    except PackageNotFoundError:
        return "not installed"
