"""Every fault of a design file is said: the file, the place, what was found, what is known, the nearest, what to do."""

import pytest

from delaytools.design.build import warnings
from delaytools.signals.trouble import DelaytoolsError
from tests.design.benches import BENCH, DRIVE, effect, loaded, spoilt

EQUATIONS = BENCH + DRIVE
ALGEBRAIC = """
[blocks.first]
type = "{kind}"
input = "h"
output = "g"
{value}
[blocks.second]
type = "gain"
input = "g"
output = "h"
gain = 2.0
"""
CIRCLE = '\n[configurations.one]\nextend = "two"\n[configurations.two]\nextend = "one"\n'


def drive(old: str, new: str) -> str:
    return spoilt(old, new, EQUATIONS)


def overriding(path: str, value: str = "1.0") -> str:
    return BENCH + f'\n[configurations.late]\nset = {{ "{path}" = {value} }}\n'


def driven(text: str) -> str:
    return BENCH + f"\n[inputs]\ndemand = {text}\n"


# (what is wrong) -> (the design, what its message must say)
FAULTS = {
    # wiring
    "two writers": (
        spoilt('output = "fin"\n', 'output = "fin_command"\n'),
        ("signal fin_command", "two writers", "autopilot and actuator", "give each"),
    ),
    "signal that nearly is another": (
        spoilt("kp*rate", "kp*raet"),
        ("blocks.autopilot.input", "unknown signal", "'raet'", "known: demand", "nearest: rate", "[signals]"),
    ),
    "factor that is no parameter": (
        spoilt("kp*rate", "kd*rate"),
        ("blocks.autopilot.input", "no parameter", "'kd'", "known: kp", "nearest: kp", "[parameters]"),
    ),
    "product of signals": (
        spoilt("kp*rate", "demand*rate"),
        ("blocks.autopilot.input", "linear combination", "'demand - demand*rate'", "equations block"),
    ),
    "function of a signal": (
        spoilt('input = "fin"', 'input = "abs(fin)"'),
        ("blocks.airframe.input", "linear"),
    ),
    "input without a signal": (spoilt('"demand - kp*rate"', '"3*kp"'), ("reads no signal", "name a signal")),
    "no input": (
        spoilt('input = "fin"\n', ""),
        ("blocks.airframe.input", "missing required value", "input ="),
    ),
    "no output": (spoilt('output = "fin"\n', ""), ("blocks.actuator.output", "missing required value")),
    "input and inputs": (
        spoilt('input = "fin"\n', 'input = "fin"\ninputs = ["fin"]\n'),
        ("blocks.airframe", "both input and inputs", "give one"),
    ),
    "too many signals": (
        spoilt('input = "fin"\n', 'inputs = ["fin", "rate"]\n'),
        ("found 2", "give 1, for input"),
    ),
    "unknown port": (
        spoilt('input = "fin"\n', 'inputs = { inptu = "fin" }\n'),
        ("blocks.airframe.input", "unknown port", "'inptu'", "known: input", "nearest: input"),
    ),
    "output that is a formula": (
        spoilt('output = "fin"\n', 'output = "2*fin"\n'),
        ("'2*fin' cannot be the name",),
    ),
    "algebraic loop": (
        BENCH + ALGEBRAIC.format(kind="gain", value="gain = 2.0"),
        ("algebraic loop", "g -> h -> g", "dynamics or a delay"),
    ),
    "sampled loop without dynamics": (
        BENCH + ALGEBRAIC.format(kind="sample_hold", value='period = "5 ms"'),
        ("algebraic loop", "g -> h -> g"),
    ),
    "algebraic loop closed by a neutral delay": (
        BENCH + ALGEBRAIC.format(kind="delay", value="delay = 0"),
        ("algebraic loop", "g -> h -> g"),
    ),
    # names
    "parameter named like a written signal": (
        spoilt("kp = 0.045", "kp = 0.045\nfin = 3"),
        ("parameters.fin", "one name for a signal and a parameter", "rename"),
    ),
    "parameter named like an input": (
        spoilt("kp = 0.045", "kp = 0.045\ndemand = 3"),
        ("parameters.demand", "one name for a signal and a parameter"),
    ),
    "parameter with a word of formulas": (
        spoilt("kp = 0.045", "kp = 0.045\nlambda = 3"),
        ("parameters.lambda", "cannot be the name", "choose another"),
    ),
    "parameter that is π": (
        spoilt("kp = 0.045", "kp = 0.045\npi = 3"),
        ("parameters.pi", "cannot be the name"),
    ),
    "block name with a dot": (
        spoilt("[blocks.actuator]", '[blocks."a.b"]'),
        ("'a.b' cannot be the name of a block",),
    ),
    "block named parameters": (
        spoilt("[blocks.actuator]", "[blocks.parameters]"),
        ("cannot be the name of a block",),
    ),
    # types and values
    "unknown block type": (
        spoilt('"second_order"', '"secondorder"'),
        (
            "blocks.actuator.type",
            "unknown block type",
            "'secondorder'",
            "known: backlash",
            "nearest: second_order",
        ),
    ),
    "no type": (spoilt('type = "second_order"\n', ""), ("blocks.actuator.type", "missing required value")),
    "unknown value": (
        spoilt("damping = 0.6", "damping = 0.6\ngian = 2"),
        ("blocks.actuator.gian", "unknown value", "'gian'", "known: damping, gain", "nearest: gain"),
    ),
    "missing value": (
        spoilt("damping = 0.6\n", ""),
        ("blocks.actuator.damping", "missing required value", "give damping"),
    ),
    "missing value with a unit": (
        spoilt('natural_frequency = "180 rad/s"\n', ""),
        ("blocks.actuator.natural_frequency", "give natural_frequency (in rad/s)"),
    ),
    "negative damping": (spoilt("0.6", "-0.6"), ("blocks.actuator.damping", "bounds", "-0.6", "0 or more")),
    "zero frequency": (spoilt('"180 rad/s"', "0"), ("blocks.actuator.natural_frequency", "above 0")),
    "formula outside the bounds": (spoilt("0.6", '"-2*kp"'), ("actuator.damping", "bounds", "-0.09")),
    "negative period": (spoilt('"5 ms"', '"-5 ms"'), ("blocks.autopilot.period", "'-5 ms'", "0 or more")),
    "infinite period": (spoilt('"5 ms"', "inf"), ("blocks.autopilot.period", "infinite")),
    "not a number": (spoilt("0.6", "nan"), ("blocks.actuator.damping", "not a number")),
    "true is no number": (spoilt("0.6", "true"), ("blocks.actuator.damping", "a number is wanted", "True")),
    "list for a number": (spoilt("0.6", "[0.6]"), ("blocks.actuator.damping", "one number")),
    "number for a list": (
        spoilt("[900.0]", "900.0"),
        ("blocks.airframe.numerator", "a list of numbers", "900.0"),
    ),
    "matrix for a list": (spoilt("[900.0]", "[[900.0]]"), ("blocks.airframe.numerator", "a list of numbers")),
    "empty list": (spoilt("[1.0, 2.0]", "[]"), ("blocks.airframe.denominator", "a list without numbers")),
    "not proper": (
        spoilt("[900.0]", "[9, 9, 9]"),
        ("blocks.airframe", "not proper", "degree 2 over degree 1"),
    ),
    "leading zero": (spoilt("[1.0, 2.0]", "[0, 2]"), ("blocks.airframe", "highest coefficient is zero")),
    "unknown name in a value": (
        spoilt("0.6", '"2*kq"'),
        ("blocks.actuator.damping", "unknown name", "'kq'", "known: kp", "nearest: kp"),
    ),
    # units
    "unknown unit": (
        spoilt('"180 rad/s"', '"180 rad/sec"'),
        (
            "blocks.actuator.natural_frequency",
            "unknown unit in 'rad/sec'",
            "'sec'",
            "known: rad",
            "nearest: s",
        ),
    ),
    "unknown unit of a signal": (
        spoilt('rate = "deg/s"', 'rate = "degs/s"'),
        ("signals.rate", "unknown unit", "'degs'", "nearest: deg"),
    ),
    "wrong dimension": (
        spoilt('"180 rad/s"', '"180 s"'),
        ("blocks.actuator.natural_frequency", "wrong dimension", "'180 s'", "give it in rad/s"),
    ),
    "wrong dimension of a time": (
        spoilt('"5 ms"', '"5 deg"'),
        ("blocks.autopilot.period", "'5 deg'", "in s"),
    ),
    # the frame
    "frame of 0": (spoilt('frame = "1 ms"', "frame = 0"), ("frame", "above 0", "found 0")),
    "negative frame": (spoilt('frame = "1 ms"', 'frame = "-1 ms"'), ("frame", "above 0", "'-1 ms'")),
    "frame in degrees": (spoilt('frame = "1 ms"', 'frame = "1 deg"'), ("frame", "wrong dimension", "in s")),
    "frame as a list": (spoilt('frame = "1 ms"', "frame = [1]"), ("frame", "a number or a quantity", "[1]")),
    "infinite frame": (spoilt('frame = "1 ms"', "frame = inf"), ("frame", "above 0")),
    # parameters
    "circular parameters": (
        spoilt("kp = 0.045", 'kp = "2*kq"\nkq = "kp/2"'),
        ("parameters", "circle", "kp -> kq -> kp", "as a number"),
    ),
    "parameter of itself": (spoilt("kp = 0.045", 'kp = "kp + 1"'), ("circle", "kp -> kp")),
    "unknown parameter": (
        spoilt("kp = 0.045", 'kp = 0.045\nkq = "2*kz"'),
        ("parameters.kq", "unknown name", "'kz'", "known: kp, kq"),
    ),
    "parameter with an unknown unit": (
        spoilt("kp = 0.045", 'kp = "3 degs"'),
        ("parameters.kp", "nearest: deg"),
    ),
    "parameter divided by zero": (
        spoilt("kp = 0.045", 'kp = "1/0"'),
        ("parameters.kp", "division by zero", "'1/0'"),
    ),
    "logarithm of -1": (spoilt("kp = 0.045", 'kp = "log(-1)"'), ("parameters.kp", "without a finite value")),
    "root of -1": (spoilt("kp = 0.045", 'kp = "(-1)**0.5"'), ("parameters.kp", "no real number")),
    "overflow": (spoilt("kp = 0.045", 'kp = "9.0**9**9"'), ("parameters.kp", "too large")),
    # tables and keys
    "unknown table": (
        BENCH + "[input]\na = 1\n",
        ("input", "unknown key", "known: title", "nearest: inputs"),
    ),
    "unknown key": (BENCH + "[simulation]\nduratoin = 1\n", ("simulation.duratoin", "nearest: duration")),
    "key at the wrong place": ("foo = 1\n" + BENCH, ("foo", "unknown key", "the table it belongs to")),
    "one effect as a table": (
        BENCH + '[effects]\ntype = "delay"\n',
        ("effects", "a list is wanted", "[[effects]]"),
    ),
    "no blocks": ('title = "x"\n', ("without blocks", "[blocks.NAME]")),
    # effects
    "unknown effect": (
        effect('type = "dely"', 'at = "actuator.input"'),
        ("effects.0", "unknown effect type", "'dely'", "known: backlash", "nearest: delay"),
    ),
    "effect without a place": (
        effect('type = "delay"', "delay = 0.1"),
        ("effects.0.at", "missing required value"),
    ),
    "unknown port of an effect": (
        effect('type = "delay"', 'at = "actuator.inptu"', "delay = 0.1"),
        ("effects.0", "unknown port", "'actuator.inptu'", "known: actuator.input", "nearest: actuator.input"),
    ),
    "unknown block of an effect": (
        effect('type = "delay"', 'at = "actuater.input"', "delay = 0.1"),
        ("effects.0", "unknown port", "known: actuator", "nearest: actuator", "BLOCK.input"),
    ),
    "unknown value of an effect": (
        effect('type = "delay"', 'at = "actuator.input"', "delay = 0.1", "dely = 1"),
        ("effects.0", "unknown value", "'dely'", "known: delay", "nearest: delay"),
    ),
    "missing value of an effect": (
        effect('type = "delay"', 'at = "actuator.input"'),
        ("effects.0", "missing required value", "give delay (in s)"),
    ),
    "negative delay": (
        effect('type = "delay"', 'at = "actuator.input"', 'delay = "-5 ms"'),
        ("effects.0", "outside its bounds", "'-5 ms'", "0 or more"),
    ),
    "infinite delay": (
        effect('type = "delay"', 'at = "fin.input"', "delay = inf").replace("fin.", "actuator."),
        ("infinite",),
    ),
    "effect with a wrong dimension": (
        effect('type = "dead_band"', 'at = "actuator.input"', 'half_width = "3 ms"'),
        ("effects.0", "wrong dimension", "'3 ms'", "give it in deg"),
    ),
    "quantity where signals differ": (
        effect('type = "dead_band"', 'at = "autopilot.input"', 'half_width = "0.3 deg"'),
        ("effects.0", "unit of the place is not known", "bare number"),
    ),
    "friction at an input": (
        effect('type = "coulomb_friction"', 'at = "actuator.input"', "level = 1.0"),
        ("effects.0", "cannot act here", "kind input", "known: derivative"),
    ),
    "delay at a derivative": (
        effect('type = "delay"', 'at = "actuator.rate\'"', "delay = 0.1"),
        ("effects.0", "cannot act here", "kind derivative", "known: input, output"),
    ),
    "delay at a whole block": (
        effect('type = "delay"', 'at = "actuator"', "delay = 0.1"),
        ("effects.0", "cannot act here", "kind block"),
    ),
    "dropped frames of a continuous block": (
        effect('type = "dropped_frames"', 'at = "actuator.output"', "probability = 0.1"),
        ("effects.0", "output of a sampled block", "known: autopilot.output"),
    ),
    "probability above 1": (
        effect('type = "dropped_frames"', 'at = "autopilot.output"', "probability = 2"),
        ("effects.0", "probability", "from 0 to 1"),
    ),
    "unknown source": (
        effect('type = "cross_coupling"', 'at = "airframe.input"', "gain = 0.1", 'source = "finn"'),
        ("effects.0", "source", "unknown signal", "'finn'", "nearest: fin"),
    ),
    "change of nothing": (
        effect('type = "parameter_change"', 'at = "actuator"', "damping = 0.5"),
        ("effects.0", "which value", "parameter_change:damping"),
    ),
    "change of an unknown value": (
        effect('type = "parameter_change:dampng"', 'at = "actuator"', "dampng = 0.5"),
        ("effects.0", "'dampng'", "known: damping", "nearest: damping"),
    ),
    "change out of bounds": (
        effect('type = "parameter_change:damping"', 'at = "actuator"', "damping = -1"),
        ("effects.0", "damping", "bounds", "0 or more"),
    ),
    # equations
    "forbidden call": (
        drive('q = "v"', "q = \"__import__('os')\""),
        ("blocks.drive.rates.q", "__import__('os')", "not allowed", "known: + - * / **"),
    ),
    "unknown name in a formula": (
        drive("viscous*v)", "viscus*v)"),
        ("blocks.drive.rates.v", "unknown name", "'viscus'", "nearest: viscous"),
    ),
    "signal that does not enter": (
        drive("viscous*v)", "fin*v)"),
        ("blocks.drive.rates.v", "'fin'", "through its inputs"),
    ),
    "clash inside a formula": (
        drive("viscous = 203.5", "viscous = 203.5, kp = 1").replace("(u - ", "(kp*u - "),
        ("blocks.drive", "one name with two meanings", "kp", "rename"),
    ),
    "state and input of one name": (
        drive('{ u = "rate" }', '{ u = "rate", v = "fin" }'),
        ("blocks.drive", "one name with two meanings", "found v"),
    ),
    "state without a rate": (
        drive('q = "v", ', ""),
        ("blocks.drive", "every state needs one rate", "found q"),
    ),
    "no outputs": (
        drive('outputs = { position = "q" }\n', ""),
        ("blocks.drive.outputs", "missing required value"),
    ),
    "unknown key of equations": (
        drive("states =", "state ="),
        ("blocks.drive.state", "unknown value", "known: inputs, states", "nearest: states"),
    ),
    "rates as text": (
        drive('rates = { q = "v", v = "(u - viscous*v)/mass" }', 'rates = "v"'),
        ("blocks.drive.rates", "rates = {"),
    ),
    "input that is a number": (drive('"rate" }', "3 }"), ("blocks.drive.inputs.u", "found 3")),
    "non-linear input of equations": (
        drive('"rate" }', '"rate*fin" }'),
        ("blocks.drive.u", "linear combination"),
    ),
    "true as a formula": (
        drive('q = "v"', "q = true"),
        ("blocks.drive.rates.q", "a formula is wanted", "True"),
    ),
    # configurations
    "extend in a circle": (BENCH + CIRCLE, ("configurations.two.extend", "circle", "one -> two -> one")),
    "extend of nothing": (
        BENCH + '\n[configurations.one]\nextend = "tow"\n[configurations.two]\n',
        ("configurations.one.extend", "unknown configuration", "'tow'", "known: one, two", "nearest: two"),
    ),
    "override of an unknown value": (
        overriding("actuator.dampng"),
        ("configurations.late.set", "unknown path", "'actuator.dampng'", "nearest: actuator.damping"),
    ),
    "override of an unknown block": (
        overriding("actuater.damping"),
        ("configurations.late.set", "nearest: actuator"),
    ),
    "override of an unknown parameter": (overriding("parameters.kq"), ("known: parameters.kp",)),
    "override of an effect that is not there": (
        overriding("effects.0.delay"),
        ("unknown path", "no [[effects]]"),
    ),
    "override of an element that is not there": (
        overriding("airframe.denominator[5]"),
        ("no such element", "known: airframe.denominator[0], airframe.denominator[1]", "from 0"),
    ),
    "path without quotes": (
        BENCH + "\n[configurations.late]\nset = { actuator.damping = 0.4 }\n",
        ("configurations.late.set", '"actuator.damping"'),
    ),
    "unknown effect of a configuration": (
        BENCH + '\n[configurations.late]\neffects = [ { type = "dely", at = "actuator.input" } ]\n',
        ("configurations.late.effects.0", "unknown effect type", "nearest: delay"),
    ),
    # what drives it
    "input that a block writes": (
        BENCH + '[inputs]\nfin = { type = "step", amplitude = 1.0 }\n',
        ("inputs.fin", "not an external input", "known: demand", "written by the block actuator"),
    ),
    "input that nothing reads": (
        BENCH + '[inputs]\ndemnd = { type = "step", amplitude = 1.0 }\n',
        ("inputs.demnd", "not an external input", "nearest: demand", "no block reads"),
    ),
    "unknown type of input": (
        driven('{ type = "stp", amplitude = 1.0 }'),
        ("inputs.demand", "unknown type", "'stp'", "known: step", "nearest: step"),
    ),
    "input without a type": (
        driven("{ amplitude = 1.0 }"),
        ("inputs.demand", "missing required value", "type ="),
    ),
    "type that is a list": (driven('{ type = ["step"] }'), ("inputs.demand", "unknown type", "['step']")),
    "missing key of an input": (
        driven('{ type = "doublet", amplitude = 1.0 }'),
        ("inputs.demand", "missing required value", "a doublet without width", "give width"),
    ),
    "unknown key of an input": (
        driven('{ type = "step", amplitude = 1.0, strat = 2.0 }'),
        ("inputs.demand", "unknown value of a step", "'strat'", "nearest: start"),
    ),
    "input with a wrong dimension": (
        driven('{ type = "step", amplitude = "5 s" }'),
        ("inputs.demand", "amplitude", "wrong dimension", "'5 s'", "in deg"),
    ),
    "negative width": (driven('{ type = "pulse", amplitude = 1.0, width = -1 }'), ("width", "above 0", "-1")),
    "chirp without a duration": (
        driven('{ type = "chirp", amplitude = 1.0, band = [1, 9], duration = 0 }'),
        ("duration", "above 0"),
    ),
    "band downwards": (
        driven('{ type = "chirp", amplitude = 1.0, band = [9, 1], duration = 5 }'),
        ("band", "lower to a higher", "[9, 1]"),
    ),
    "lines that are no count": (
        driven('{ type = "multisine", amplitude = 1.0, band = [1, 9], lines = "x" }'),
        ("lines", "a count", "'x'"),
    ),
    "formula of an unknown name": (
        driven('{ type = "formula", formula = "sin(x)" }'),
        ("inputs.demand", "'x'", "known: t, pi"),
    ),
    # the other tables
    "removal of nothing": (
        BENCH + '[flight]\nremove = ["actuater"]\n',
        ("flight.remove.0", "nothing of that name", "'actuater'", "nearest: actuator"),
    ),
    "removal of an unknown effect": (
        effect('type = "delay"', 'at = "actuator.input"', "delay = 0.1")
        + '[flight]\nremove = ["dely@actuator.input"]\n',
        ("flight.remove.0", "unknown effect", "nearest: delay@actuator.input"),
    ),
    "tolerance of nothing": (
        BENCH + '[tolerance]\n"actuator.dampng" = "6 %"\n',
        ('tolerance."actuator.dampng"', "no such value", "nearest: actuator.damping"),
    ),
    "tolerance without quotes": (
        BENCH + '[tolerance]\nactuator.damping = "6 %"\n',
        ("tolerance.actuator", '"actuator.damping"'),
    ),
    "negative tolerance": (BENCH + '[tolerance]\n"actuator.damping" = "-6 %"\n', ("above 0", "'-6 %'")),
    "tolerance with a wrong dimension": (
        BENCH + '[tolerance]\n"actuator.natural_frequency" = "6 s"\n',
        ("wrong dimension", "'6 s'", "rad/s"),
    ),
    "analysis at nothing": (
        BENCH + '[analysis]\nat = "fin_comand"\n',
        ("analysis.at", "unknown signal", "'fin_comand'", "nearest: fin_command"),
    ),
    "analysis at an input": (
        BENCH + '[analysis]\nat = "demand"\n',
        ("analysis.at", "no block writes", "known: fin_command"),
    ),
    "delay at nothing": (
        BENCH + '[analysis]\ndelay_at = "actuator.inptu"\n',
        ("analysis.delay_at", "unknown port", "nearest: actuator.input"),
    ),
    "delay at a rate": (
        BENCH + '[analysis]\ndelay_at = "actuator.rate"\n',
        ("analysis.delay_at", "write actuator.input"),
    ),
    "tuning of nothing": (
        BENCH + "[tuning]\nvary = { kq = [0.1, 0.2] }\n",
        ("tuning.vary.kq", "no such value", "'kq'", "nearest: kp"),
    ),
    "tuning downwards": (
        BENCH + "[tuning]\nvary = { kp = [0.2, 0.1] }\n",
        ("tuning.vary.kp", "lower to a higher"),
    ),
    "goal without a type": (BENCH + "[tuning]\ngoals = [ { max = 3 } ]\n", ("tuning.goals.0", "type")),
    "run of no length": (
        BENCH + "[simulation]\nduration = -1\n",
        ("simulation.duration", "longer than 0", "-1"),
    ),
    "duration in degrees": (
        BENCH + '[simulation]\nduration = "1 deg"\n',
        ("simulation.duration", "wrong dimension"),
    ),
    "seed with a fraction": (
        BENCH + "[simulation]\nseed = 1.5\n",
        ("simulation.seed", "whole number", "1.5"),
    ),
    # the text itself
    "no TOML": (BENCH + "[blocks.gyro\n", ("not a TOML file", "line", "mend the line")),
    "one table twice": (BENCH + '[blocks.actuator]\ntype = "gain"\n', ("not a TOML file", "line")),
}


@pytest.mark.parametrize("text, words", FAULTS.values(), ids=FAULTS)
def test_a_fault_is_said(text: str, words: tuple[str, ...]) -> None:
    with pytest.raises(DelaytoolsError) as caught:
        loaded(text)
    message = str(caught.value)
    assert message.startswith("bench.toml: "), message
    assert message.count("bench.toml") == 1, message
    for word in words:
        assert word in message, message


FORBIDDEN = {
    "__import__('os')": "__import__('os')",
    "demand.real": "demand.real",
    "(lambda: 1)()": "lambda",
    "demand > 1": "demand > 1",
    "'x'": "'x'",
    "demand if rate else 0": "demand if rate else 0",
    "[1]": "[1]",
    "demand @ rate": "demand @ rate",
    "demand // 2": "demand // 2",
    "demand and rate": "demand and rate",
    "f'{demand}'": "f'{demand}'",
    "True*demand": "True",
    "demand[0]": "demand[0]",
    "open(1)": "open(1)",
    "1j*demand": "1j",
    "~demand": "~demand",
    "demand; rate": "not a formula",
    "demand := 2": "not a formula",
    "demand +": "not a formula",
    "": "not a formula",
    "demand # why": "comment",
    "sin(demand, rate)": "sin takes one value",
    "min(demand)": "min takes two values or more",
    "sin": "write sin(…)",
    "1e400*demand": "too large",
    "9**9**9**9*demand": "too large",
    "demand/0": "without a finite value",
    "-" * 3000 + "demand": "too many terms",
    "+".join(["demand"] * 5000): "too many terms",
}


@pytest.mark.parametrize("formula, word", FORBIDDEN.items(), ids=[key[:20] or "nothing" for key in FORBIDDEN])
def test_nothing_but_formulas_is_read(formula: str, word: str) -> None:
    with pytest.raises(DelaytoolsError) as caught:
        loaded(spoilt('"demand - kp*rate"', f'"""{formula}"""'))
    message = str(caught.value)
    assert message.startswith("bench.toml: blocks.autopilot.input: "), message
    assert word in message, message
    assert len(message) < 500, "a message is cut where what was found is long"


def test_several_faults_are_all_said() -> None:
    text = spoilt('"second_order"', '"secondorder"').replace("kp*rate", "abs(rate)")
    text = text.replace("numerator = [900.0]", "numerater = [900.0]\ndenominater = 3")
    text += '\n[[effects]]\ntype = "dely"\nat = "airframe.input"\n[[effects]]\ntype = "delay"\nat = "autopilot.inptu"\n'
    with pytest.raises(DelaytoolsError) as caught:
        loaded(text)
    message = str(caught.value)
    assert message.startswith("bench.toml: 7 faults\n"), message
    for word in ("secondorder", "abs(rate)", "numerater", "denominater", "missing", "dely", "inptu"):
        assert word in message, message
    assert len(message.splitlines()) == 1 + len(caught.value.each)


def test_both_wrong_values_of_a_block_are_said() -> None:
    text = spoilt("0.6", "-0.6").replace('"180 rad/s"', '"180 s"')
    with pytest.raises(DelaytoolsError, match="2 faults") as caught:
        loaded(text)
    assert "natural_frequency" in str(caught.value) and "damping" in str(caught.value)


def test_nothing_is_said_of_effects_at_a_faulty_block() -> None:
    with pytest.raises(DelaytoolsError) as caught:
        loaded(
            effect('type = "delay"', 'at = "actuator.input"', "delay = 0.1").replace('"second_order"', '"x"')
        )
    assert "effects.0" not in str(caught.value)


@pytest.mark.parametrize("name", ["one", "nope"])
def test_a_chosen_configuration_that_cannot_be(name: str) -> None:
    with pytest.raises(
        DelaytoolsError, match=r"bench.toml: .*(circle|unknown configuration; found 'nope'; known: one, two)"
    ):
        loaded(BENCH + CIRCLE, name)


@pytest.mark.parametrize(
    "path, value, word",
    [
        ("actuator.damping", "-1.0", "0 or more"),
        ("actuator.natural_frequency", '"3 s"', "wrong dimension"),
        ("actuator.natural_frequency", "[1, 2]", "one number"),
    ],
)
def test_an_override_is_checked_like_the_file(path: str, value: str, word: str) -> None:
    with pytest.raises(DelaytoolsError, match=f"blocks.{path}.*{word}"):
        loaded(overriding(path, value), "late")


def test_declared_but_unused_is_a_warning() -> None:
    design, loop = loaded(spoilt('rate = "deg/s"', 'rate = "deg/s"\nfin_angle = "deg"'))
    (word,) = warnings(design, loop)
    assert word.startswith("bench.toml: signals.fin_angle is declared but not used")


def test_an_undeclared_external_input_is_a_warning() -> None:
    design, loop = loaded(spoilt("demand - kp*rate", "demand + gust - kp*rate"))
    (word,) = warnings(design, loop)
    assert "gust is an external input that [signals] does not declare" in word


def test_a_draw_is_no_undeclared_input() -> None:
    text = effect('type = "dropped_frames"', 'at = "autopilot.output"', 'probability = "2 %"')
    design, loop = loaded(text)
    assert warnings(design, loop) == ()


def test_a_log_column_for_no_signal_is_a_warning() -> None:
    design, loop = loaded(BENCH + '[log]\ncolumns = { PS = "raet" }\n')
    (word,) = warnings(design, loop)
    assert "log.columns.PS" in word and "nearest: rate" in word


def test_signals_that_only_differ_by_an_axis_are_no_slips() -> None:
    text = spoilt('input = "fin"\n', 'input = "fin + gust_y + fin2"\n').replace(
        "demand - ", "demand + gust_z - "
    )
    text = text.replace('rate = "deg/s"', 'rate = "deg/s"\ngust_z = "deg"')
    loaded(text)
