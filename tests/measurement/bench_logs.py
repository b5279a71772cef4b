"""A small bench, and logs of it made by the package's own simulation, with effects planted and noise added."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from delaytools.design.build import build
from delaytools.design.design import Design, parse_design
from delaytools.design.edit import with_effect
from delaytools.design.stimuli import design_stimuli
from delaytools.signals.record import Record
from delaytools.simulation.simulate import simulate

__all__ = ["BENCH", "NOISE", "bench_design", "bench_log"]

BENCH = """\
title = "A small bench"
frame = "2 ms"

[signals]
demand = "deg"
command = "deg"
fin = "deg"
rate = "deg/s"
sensed = "deg/s"

[blocks.autopilot]
type = "sample_hold"
input = "demand - 0.02*sensed"
output = "command"
period = "10 ms"

[blocks.actuator]
type = "second_order"
input = "command"
output = "fin"
natural_frequency = "90 rad/s"   # data sheet
damping = 0.6

[blocks.airframe]
type = "first_order"
input = "fin"
output = "rate"
time_constant = "0.4 s"
gain = 20.0

[blocks.gyro]
type = "second_order"
input = "rate"
output = "sensed"
natural_frequency = "200 rad/s"
damping = 0.7

[inputs]
demand = { type = "multisine", amplitude = "2 deg", band = ["0.2 Hz", "12 Hz"], lines = 40 }

[analysis]
at = "command"
"""
NOISE: Mapping[str, float] = {"fin": 0.01, "sensed": 0.05}


def bench_design(text: str = BENCH) -> Design:
    """The bench as its engineers believe it to be."""
    return parse_design(text, "bench.toml")


def bench_log(
    *effects: Mapping[str, Any],
    noise: Mapping[str, float] = NOISE,
    seed: int = 1,
    duration: float = 10.0,
    text: str = BENCH,
) -> Record:
    """A run of the bench with these effects, white noise of these standard deviations on what was measured."""
    design = bench_design(text)
    for effect in effects:
        design = with_effect(design, effect)
    loop = build(design)
    record = simulate(loop, design_stimuli(design, loop), duration=duration, seed=seed).record
    draw = np.random.default_rng(seed)
    columns = {name: record[name] for name in ("demand", "command", "fin", "rate", "sensed")}
    noisy = {name: columns[name] + size * draw.standard_normal(len(record)) for name, size in noise.items()}
    return Record(record.time, {**columns, **noisy}, record.units, record.held, "run.csv")
