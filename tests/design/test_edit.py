"""Editing a design touches the lines it must and no other mark."""

import difflib

import pytest

from delaytools.design.design import Design, parse_design
from delaytools.design.edit import with_effect, with_value, without_effect
from delaytools.design.file import read_design
from delaytools.signals.trouble import DelaytoolsError
from tests.design.benches import BENCH, DRIVE
from tests.design.test_files import DESIGNS, TEXTS

DEAD_BAND = {"type": "dead_band", "at": "actuator.input", "half_width": "0.3 deg"}
CHANGE = {"type": "parameter_change:denominator[1]", "at": "airframe", "denominator[1]": 2.5}
BIG = (
    BENCH
    + DRIVE
    + (
        "\n# --- effects\n[[effects]]            # first\n"
        'type = "delay"\nat = "actuator.input"\ndelay = "2 ms"   # measured\n\n'
        "# the actuator's gears\n[[effects]]\n"
        'type = "dead_band"\nat = "actuator.output"\nhalf_width = 0.1\n\n'
        '[configurations.late]\nset = { "actuator.damping" = 0.4 }   # softer\n'
    )
)


def changed(before: Design, after: Design) -> tuple[list[str], list[str]]:
    """Lines taken out and put in, with their line ends."""
    lines = list(difflib.ndiff(before.text.splitlines(True), after.text.splitlines(True)))
    return [x[2:] for x in lines if x[0] == "-"], [x[2:] for x in lines if x[0] == "+"]


VALUES = [
    ("actuator.damping", 0.5, "damping = 0.6\n", "damping = 0.5\n"),
    (
        "actuator.natural_frequency",
        "25 Hz",
        'natural_frequency = "180 rad/s"\n',
        'natural_frequency = "25 Hz"\n',
    ),
    ("parameters.kp", 0.05, "kp = 0.045\n", "kp = 0.05\n"),
    ("airframe.denominator[1]", 3.5, "denominator = [1.0, 2.0]\n", "denominator = [1.0, 3.5]\n"),
    ("airframe.numerator", [1.0, 2.0], "numerator = [900.0]\n", "numerator = [1.0, 2.0]\n"),
    ("effects.0.delay", "3 ms", 'delay = "2 ms"   # measured\n', 'delay = "3 ms"   # measured\n'),
    (
        "drive.mass",
        90.0,
        "parameters = { mass = 95.1, viscous = 203.5 }\n",
        "parameters = { mass = 90.0, viscous = 203.5 }\n",
    ),
]


@pytest.mark.parametrize("path, value, old, new", VALUES, ids=[row[0] for row in VALUES])
def test_a_value_changes_its_own_line(path: str, value: object, old: str, new: str) -> None:
    before = parse_design(BIG)
    assert changed(before, with_value(before, path, value)) == ([old], [new])


def test_a_comment_stands_above_the_value() -> None:
    before = parse_design(BIG)
    after = with_value(before, "actuator.damping", 0.5, comment="fitted\nto run 7")
    assert changed(before, after) == (["damping = 0.6\n"], ["# fitted\n", "# to run 7\n", "damping = 0.5\n"])


@pytest.mark.parametrize("change", TEXTS.values(), ids=TEXTS)
def test_a_default_gets_a_line_of_its_own(change) -> None:
    before = parse_design(change(BIG))
    after = with_value(before, "actuator.gain", 1.06)
    taken, put = changed(before, after)
    assert taken == []
    assert [line.strip() for line in put] == ["gain = 1.06"]
    assert after.data["blocks"]["actuator"]["gain"] == 1.06


@pytest.mark.parametrize("change", TEXTS.values(), ids=TEXTS)
@pytest.mark.parametrize("text", [BENCH, BIG, *(read_design(p).text for p in DESIGNS)])
@pytest.mark.parametrize("comment", ["", "from run 7: 0.3 deg\n± 0.02"])
def test_an_effect_added_and_removed_leaves_the_same_bytes(change, text: str, comment: str) -> None:
    before = parse_design(change(text))
    one = with_effect(before, DEAD_BAND, comment=comment)
    two = with_effect(one, CHANGE, comment=comment)
    count = len(before.data.get("effects", []))
    assert two.data["effects"][count:] == [DEAD_BAND, CHANGE]
    assert without_effect(two, count + 1).text == one.text
    assert without_effect(one, count).text == before.text
    taken, put = changed(before, one)
    assert "".join(put).count("[[effects]]") == 1
    assert len(put) - len(taken) == 5 + len(comment.splitlines())


def test_an_added_effect_stands_after_a_blank_line_under_its_comment() -> None:
    after = with_effect(parse_design(BENCH), DEAD_BAND, comment="gears")
    assert after.text == BENCH + (
        '\n# gears\n[[effects]]\ntype = "dead_band"\nat = "actuator.input"\nhalf_width = "0.3 deg"\n'
    )


def test_an_effect_goes_after_the_last_one_and_before_the_next_table() -> None:
    after = with_effect(parse_design(BIG), DEAD_BAND)
    assert after.text.index('half_width = "0.3 deg"') < after.text.index("[configurations.late]")
    assert after.text.index('half_width = "0.3 deg"') > after.text.index("half_width = 0.1")


def test_removing_an_effect_takes_its_comment_and_nothing_else() -> None:
    before = parse_design(BIG)
    taken, put = changed(before, without_effect(before, 1))
    assert put == []
    assert sorted(line for line in taken if line.strip()) == sorted(
        [
            "# the actuator's gears\n",
            "[[effects]]\n",
            'type = "dead_band"\n',
            'at = "actuator.output"\n',
            "half_width = 0.1\n",
        ]
    )


@pytest.mark.parametrize(
    "act, word",
    [
        (lambda d: with_value(d, "actuator.dampng", 1.0), "nearest: actuator.damping"),
        (lambda d: with_value(d, "actuater.damping", 1.0), "nearest: actuator"),
        (lambda d: with_value(d, "effects.7.delay", 1.0), "unknown path"),
        (lambda d: with_value(d, "airframe.numerator[4]", 1.0), "no such element"),
        (lambda d: without_effect(d, 2), "no such effect; found 2; known: 0, 1"),
        (lambda d: without_effect(d, -1), "no such effect"),
    ],
)
def test_what_is_not_there_cannot_be_edited(act, word: str) -> None:
    with pytest.raises(DelaytoolsError) as caught:
        act(parse_design(BIG, "bench.toml"))
    assert str(caught.value).startswith("bench.toml: ") and word in str(caught.value)


def test_an_effect_that_a_configuration_counts_on_stays() -> None:
    text = BIG.replace('"actuator.damping" = 0.4', '"effects.1.half_width" = 0.4')
    with pytest.raises(DelaytoolsError, match=r"configurations.late.set.*effects.1.half_width"):
        without_effect(parse_design(text), 0)


def test_inline_effects_are_refused_with_advice() -> None:
    text = 'effects = [ { type = "delay", at = "actuator.input", delay = 0.1 } ]\n' + BENCH
    with pytest.raises(DelaytoolsError, match=r"write each under \[\[effects\]\]"):
        with_effect(parse_design(text), DEAD_BAND)
    assert with_value(parse_design(text), "effects.0.delay", 0.2).data["effects"][0]["delay"] == 0.2
