"""The effects at one port: grouped so that one array operation serves all lanes that have the same effect there."""

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.hidden_effects import delay_effects, memory_effects, plain_effects
from benchmarks.hidden_effects.wave import Clock, Wave

Array = np.ndarray
MAKERS = {
    **dict.fromkeys(plain_effects.STATIC, plain_effects.Static),
    **dict.fromkeys(plain_effects.TIMED, plain_effects.Timed),
    "transient_gain": plain_effects.Transient,
    "cross_coupling": plain_effects.Coupling,
    "backlash": memory_effects.Follower,
    "rate_limit": memory_effects.Follower,
    "bouc_wen": memory_effects.Follower,
    "bent_lag": memory_effects.Follower,
    "sample_hold": memory_effects.Hold,
    "lag": memory_effects.Lag,
    "flexible_mode": memory_effects.Mode,
    "delay": delay_effects.Delay,
    "variable_delay": delay_effects.Delay,
}


class Port:
    """All effects at one port, in the order of the lanes' lists."""

    def __init__(self, lists: Sequence[Sequence]) -> None:
        """lists: for every lane the effects at this port (effect, parameters, source)."""
        self.slots = []
        for slot in range(max((len(effects) for effects in lists), default=0)):
            groups: dict[tuple, list[int]] = {}
            for lane, effects in enumerate(lists):
                if slot < len(effects):
                    groups.setdefault((effects[slot].effect, effects[slot].source), []).append(lane)
            self.slots.append([_group(key, lanes, lists, slot) for key, lanes in groups.items()])

    def apply(self, wave: Wave, clock: Clock, leading: bool, signals: Mapping[str, Wave]) -> Wave:
        """The wave behind the port."""
        if not self.slots:
            return wave
        wave = wave.copy()
        for groups in self.slots:
            for lanes, source, effect in groups:
                beside = signals[source].take(lanes) if source else None
                wave.put(lanes, effect.apply(wave.take(lanes), clock, leading, beside))
        return wave


def _group(
    key: tuple, lanes: list[int], lists: Sequence[Sequence], slot: int
) -> tuple[Array, str | None, object]:
    name, source = key
    parts = [lists[lane][slot].parameters for lane in lanes]
    values = {k: np.array([p[k] for p in parts]) for k in parts[0]}
    return np.array(lanes), source, MAKERS[name](name, values)
