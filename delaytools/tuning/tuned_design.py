"""The tuned design: the same text with one more configuration, which sets what tuning found."""

from delaytools.design.design import Design, parse_design
from delaytools.tuning.tune import Tuned

__all__ = ["TUNED", "tuned_design"]

TUNED = "tuned"


def tuned_design(design: Design, configuration: str | None, tuned: Tuned) -> Design:
    """The design with [configurations.tuned], which extends `configuration`; nothing else of the text changes."""
    values = ", ".join(f'"{path}" = {item.value!r}' for path, item in tuned.values.items())
    lines = [
        "",
        f"[configurations.{_free_name(design)}]",
        f'description = "Tuned: {"all goals met" if tuned.met else "not every goal met"}"',
        *([f'extend = "{configuration}"'] if configuration else []),
        f"set = {{ {values} }}",
    ]
    gap = "" if design.text.endswith("\n") else "\n"
    return parse_design(design.text + gap + "\n".join(lines) + "\n", design.name)


def _free_name(design: Design) -> str:
    number, name = 2, TUNED
    while name in design.configurations:
        name, number = f"{TUNED}_{number}", number + 1
    return name
