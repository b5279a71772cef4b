"""Bode and Nichols plots: bars end on the curve, contours are the closed loop's, nothing fails without margins."""

import math

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from delaytools.analysis.questions import loop_margins
from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.report.figure_bode import Marked, draw_bode, draw_nichols
from delaytools.report.nyquist import nyquist_curve
from tests.analysis.test_root_loci import BENCHES

LOOPS = {
    **BENCHES,
    "unstable": BENCHES["continuous"].replace("3*(0 - angle)", "60*(0 - angle)"),
    "without crossings": BENCHES["continuous"].replace("3*(0 - angle) - 0.4*rate", "0 - 0.004*rate"),
}
LOOK = {"a": "#0072B2"}


def marked(name: str, delay: float = 0.0) -> Marked:
    loop = build(parse_design(LOOPS[name]))
    margins = loop_margins(loop, "command", [delay], delay_at="table.input").margins[0]
    return Marked(nyquist_curve(loop, "command", "a", margins, delay_at="table.input"), margins)


def bars(panel: Axes) -> list[np.ndarray]:
    """(2, 2) x and y of every wide line."""
    return [np.array(line.get_data()) for line in panel.lines if line.get_linewidth() == 2.4]


@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.parametrize("draw", [draw_bode, draw_nichols])
def test_every_loop_is_drawn(name: str, draw: object) -> None:
    figure = draw([marked(name)], LOOK, "message")  # type: ignore[operator]
    assert isinstance(figure, Figure)
    figure.draw_without_rendering()


@pytest.mark.parametrize("name", BENCHES)
@pytest.mark.parametrize("delay", [0.0, 0.03])
def test_bars_go_from_the_curve_to_the_critical_lines(name: str, delay: float) -> None:
    one = marked(name, delay)
    upper, lower = draw_bode([one], LOOK, "message").axes[:2]
    ((hertz, levels),) = bars(upper)
    assert hertz[0] == pytest.approx(one.margins.gain_margin_frequency / (2 * np.pi))  # type: ignore[operator]
    assert levels[0] == pytest.approx(np.interp(hertz[0], one.curve.omega / (2 * np.pi), one.decibels), abs=0.05)
    ((_, degrees),) = bars(lower)
    assert abs(math.remainder(degrees[0] + 180, 360)) < 0.3
    assert degrees[1] - degrees[0] == pytest.approx(math.degrees(one.margins.phase_margin))  # type: ignore[arg-type]
    assert -360 < one.degrees[0] <= 0


def test_the_delay_of_the_margins_is_in_the_curve() -> None:
    late, plain = marked("continuous", 0.03), marked("continuous")
    omega = 20.0
    ratio = [complex(np.interp(omega, c.curve.omega, c.curve.value)) for c in (late, plain)]
    assert ratio[0] / ratio[1] == pytest.approx(np.exp(-1j * omega * 0.03), rel=1e-3)


def test_contours_are_those_of_the_closed_loop() -> None:
    panel = draw_nichols([marked("continuous")], LOOK, "message").axes[0]
    found = set()
    for line in panel.lines:
        if line.get_color() != "#d7dbe0" or len(line.get_xdata()) < 50:  # type: ignore[arg-type]
            continue
        phase, level = np.array(line.get_data())
        L = 10 ** (level / 20) * np.exp(1j * np.radians(phase))
        closed = 20 * np.log10(np.abs(L / (1 + L)))
        assert np.ptp(closed) < 1e-6
        found.add(round(float(closed[0]), 6))
    assert found == {12.0, 6.0, 3.0, 1.0, 0.0, -1.0, -3.0, -6.0, -12.0, -20.0}
