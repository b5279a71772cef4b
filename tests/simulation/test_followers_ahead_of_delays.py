"""A slew limit and a delay may change places: both look at time alone."""

import numpy as np
import pytest

from delaytools.blocks.delay import Delay
from delaytools.blocks.rate_limiter import RateLimiter
from delaytools.design.build import build
from delaytools.design.design import parse_design
from delaytools.loop.edit import insert
from delaytools.loop.port import find_port
from delaytools.signals.stimulus import Column
from delaytools.simulation.simulate import simulate
from tests.diagnosis.small_cases import SLIDE

TIME = np.arange(0, 3, 0.002)
COMMAND = np.sign(np.sin(7 * TIME)) * 5 * np.sin(3 * TIME)


@pytest.mark.parametrize(("limit", "held", "error"), [(6000.0, True, 1e-3), (500.0, True, 1e-3), (6000.0, False, 1e-9)])
def test_a_slew_limit_and_a_delay_may_change_places(limit: float, held: bool, error: float) -> None:
    """Of full scale; a held command is caught up with within a span, whose cubic keeps the area alone."""
    loop, port = build(parse_design(SLIDE)), "drive.u"
    blocks = (RateLimiter(limit=limit), Delay(delay=0.0015))
    found = []
    for first, second in (blocks, blocks[::-1]):
        both = insert(insert(loop, find_port(loop, port), first), find_port(loop, port), second)
        run = simulate(both, {"u": Column(time=TIME, values=COMMAND, held=held)}, duration=2.999)
        found.append(run.record["x"])
    assert np.abs(found[0] - found[1]).max() < error * np.abs(found[0]).max()
