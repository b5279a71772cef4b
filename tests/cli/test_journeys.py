"""The command line as an engineer meets it: answers, exit status, messages, files.

What concerns the process itself (streams, exit status, signals, time to start) runs in a process of its own; the many
refusals run the same entry point inside this one, where nothing is loaded twice.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from delaytools.cli.main import run
from delaytools.diagnosis.diagnose import Effort
from delaytools.measurement.log_file import read_log
from tests.design.benches import BENCH, DRIVE, spoilt

ROLL = Path(__file__).resolve().parents[2] / "designs" / "roll_autopilot.toml"
DRIVEN = BENCH + (
    '[inputs]\ndemand = { type = "doublet", amplitude = "5 deg", start = "0.1 s", width = "0.2 s" }\n'
    '[simulation]\nduration = "1 s"\n[analysis]\nat = "fin_command"\ndelay_at = "airframe.input"\n'
)
MARGIN_KEYS = {
    "delay",
    "stable",
    "gain_margin",
    "gain_margin_frequency",
    "phase_margin",
    "phase_margin_frequency",
    "delay_margin",
    "modulus_margin",
    "disk_margin",
    "crossings",
    "sampling",
    "linearised_without",
}


def command(*words: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-m", "delaytools.cli", *map(str, words)]
    return subprocess.run(line, capture_output=True, text=True, timeout=120, cwd=cwd)


Run = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture
def inside(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """The same as `command`, all of it in this process."""
    monkeypatch.setattr("delaytools.diagnosis.diagnose.Effort", partial(Effort, processes=1))

    def call(*words: object) -> "subprocess.CompletedProcess[str]":
        monkeypatch.setattr(sys, "argv", ["delaytools", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            run()
        out, err = capfd.readouterr()
        return subprocess.CompletedProcess(words, end.value.code, out, err)

    return call


def strict(text: str) -> dict:
    """JSON in which NaN and Infinity are no words."""

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    return json.loads(text, parse_constant=refuse)


def answered(call: Run, *words: object) -> dict:
    done = call(*words, "--json", "-")
    assert done.returncode == 0, done.stderr
    return strict(done.stdout)


def said(done: subprocess.CompletedProcess[str]) -> str:
    """The message of a command that found its input wrong."""
    assert done.returncode == 2, (done.returncode, done.stdout, done.stderr)
    assert "Traceback" not in done.stderr and "internal error" not in done.stderr, done.stderr
    assert done.stderr.startswith("delaytools: "), done.stderr
    return done.stderr


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    path.write_text(DRIVEN)
    return path


# --- what is answered ---


@pytest.mark.parametrize("design", ["roll", "bench"])
def test_margins(inside: Run, design: str, bench: Path, tmp_path: Path) -> None:
    path = ROLL if design == "roll" else bench
    target = tmp_path / "margins.json"
    done = inside("margins", path, "--delay", "0:40ms:5", "--json", target)
    assert done.returncode == 0, done.stderr
    assert "stable for delays" in done.stdout and done.stderr == ""
    found = strict(target.read_text())
    assert {"margins", "stable_delays"} <= set(found)
    assert [item["delay"] for item in found["margins"]] == pytest.approx([0, 0.01, 0.02, 0.03, 0.04])
    for item in found["margins"]:
        assert set(item) >= MARGIN_KEYS
        for key in MARGIN_KEYS - {"crossings", "sampling", "linearised_without"}:
            assert item[key] is not None or item["why"] in ("closed loop unstable", "never"), key
        assert item["sampling"] in ("exact", "continuous approximation")
    stable = [item["stable"] for item in found["margins"]]
    assert stable[0] and not stable[-1]
    unstable = found["margins"][-1]
    assert unstable["gain_margin"] is None and unstable["why"] == "closed loop unstable"
    assert all(low <= high for low, high in found["stable_delays"])


def test_only_json_on_standard_output(bench: Path) -> None:
    done = command("margins", bench, "--json", "-")
    assert set(strict(done.stdout)) >= {"margins", "stable_delays"}
    assert done.stderr == ""


def test_the_gate(inside: Run, bench: Path) -> None:
    assert inside("margins", bench, "--gate").returncode == 0
    late = inside("margins", bench, "--gate", "--delay", "40ms", "--json", "-")
    assert late.returncode == 1 and late.stderr == ""
    assert not strict(late.stdout)["margins"][0]["stable"]
    assert inside("margins", bench, "--delay", "40ms").returncode == 0


def test_a_loop_without_limits_says_never(inside: Run, tmp_path: Path) -> None:
    path = tmp_path / "first.toml"
    path.write_text(
        '[blocks.plant]\ntype = "first_order"\ntime_constant = 1.0\ngain = 0.5\ninput = "d - y"\noutput = "y"\n'
    )
    (item,) = answered(inside, "margins", path, "--at", "y")["margins"]
    assert item["stable"] and item["gain_margin"] is None and item["why"] == "never"


def test_roots(inside: Run, bench: Path) -> None:
    found = answered(inside, "roots", bench, "--delay", "0:20ms:3", "--count", "4")
    assert [item["parameter"] for item in found["roots"]] == pytest.approx([0.0, 0.01, 0.02])
    for item in found["roots"]:
        assert item["certified"] is True
        assert 0 < len(item["roots"]) <= 4 and all(len(root) == 2 for root in item["roots"])
    gains = answered(inside, "roots", bench, "--gain", "0.5:2:2")
    assert [item["parameter"] for item in gains["roots"]] == [0.5, 2.0]


def test_simulate_writes_what_inputs_reads(inside: Run, bench: Path, tmp_path: Path) -> None:
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    found = answered(inside, "simulate", bench, "--out", first)
    assert {"signals", "seconds_simulated", "real_time_factor"} <= set(found)
    assert found["seconds_simulated"] == pytest.approx(1.0)
    assert set(found["signals"]["fin"]) >= {"rms", "peak", "oscillation_amplitude", "oscillation_frequency"}
    undriven = answered(inside, "simulate", bench, "--inputs", first, "--out", second)
    assert undriven["seconds_simulated"] == pytest.approx(1.0)
    one, two = read_log(first), read_log(second)
    assert one.names == two.names and dict(one.units) == dict(two.units)
    scale = np.max(np.abs(one["fin"]))
    # the demand of the log is joined by straight lines: its jumps take one frame
    assert np.max(np.abs(one["fin"] - two["fin"])) < 0.1 * scale


def test_a_quiet_signal_has_no_frequency_and_says_why(inside: Run, tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(BENCH)
    done = inside("simulate", path, "--duration", "200ms", "--json", "-")
    assert "nothing drives the input demand: it is 0" in done.stderr
    fin = strict(done.stdout)["signals"]["fin"]
    assert fin["peak"] == 0.0 and fin["oscillation_frequency"] is None and fin["oscillation_frequency_why"]


def test_configuration_and_seed(inside: Run, bench: Path) -> None:
    text = DRIVEN.replace(
        'type = "doublet", amplitude = "5 deg", start = "0.1 s", width = "0.2 s"',
        'type = "noise", rms = "1 deg"',
    )
    bench.write_text(text + '[configurations.soft]\nset = { "parameters.kp" = 0.02 }\n')
    runs = [
        answered(inside, "simulate", bench, "--duration", "0.2s", *words)["signals"]["fin"]["rms"]
        for words in ((), ("--seed", 1), ("--seed", 2), ("--configuration", "soft"))
    ]
    assert runs[0] == runs[1] and len(set(runs)) == 3


def test_warnings_are_said_and_do_not_stop(inside: Run, bench: Path) -> None:
    bench.write_text(DRIVEN.replace('fin = "deg"', 'fin = "deg"\nspare = "deg"'))
    done = inside("margins", bench, "--json", "-")
    assert done.returncode == 0 and done.stderr.startswith("warning: ") and "signals.spare" in done.stderr
    strict(done.stdout)


def test_a_process_of_its_own(bench: Path, tmp_path: Path) -> None:
    late = command("margins", bench, "--gate", "--delay", "40ms", "--json", "-")
    assert late.returncode == 1 and late.stderr == ""
    strict(late.stdout)
    bench.write_text(spoilt("0.6", "-0.6"))
    message = said(command("simulate", bench, "--json", "-"))
    assert f"{bench}: blocks.actuator.damping" in message
    assert "Missing argument" in said(command("margins"))


# --- help ---


def test_help_answers_at_once() -> None:
    begin = time.perf_counter()
    done = command("--help")
    assert time.perf_counter() - begin < 1.0
    assert done.returncode == 0 and "margins" in done.stdout and done.stderr == ""


def test_help_loads_no_heavy_package() -> None:
    program = (
        "import sys; sys.argv = ['delaytools', '--help']\n"
        "from delaytools.cli.main import run\n"
        "try:\n    run()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'scipy', 'casadi', 'matplotlib', 'pydantic', 'sympy', 'control'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


# --- what is refused ---


def test_words_that_are_no_command(inside: Run, bench: Path, tmp_path: Path) -> None:
    cases = {
        ("margins",): ("Missing argument 'DESIGN'", "delaytools margins --help"),
        ("margin", bench): ("No such command 'margin'", "delaytools --help"),
        ("margins", bench, "--dely", "1ms"): ("No such option: --dely", "delaytools margins --help"),
        ("roots", bench, "--count", "many"): ("--count", "integer"),
        ("margins", tmp_path): (str(tmp_path), "Is a directory"),
        ("margins", tmp_path / "bnch.toml"): ("no such file", "nearest: bench.toml"),
        ("margins", bench, "--json", tmp_path / "no" / "where.json"): ("where.json", "cannot be written"),
        ("margins", bench, "--json", tmp_path): (str(tmp_path), "cannot be written"),
    }
    for words, parts in cases.items():
        message = said(inside(*words))
        for part in parts:
            assert part in message, message
    assert [p.name for p in tmp_path.iterdir()] == ["bench.toml"]


def test_answers_that_cannot_be(inside: Run, bench: Path) -> None:
    cases = {
        ("margins", bench, "--at", "fin_comand"): (
            "bench.toml: --at",
            "'fin_comand'",
            "nearest: fin_command",
        ),
        ("margins", bench, "--at", "demand"): ("--at", "'demand'", "known: fin_command"),
        ("margins", bench, "--delay-at", "actuator.inptu"): (
            "bench.toml: --delay-at",
            "nearest: actuator.input",
        ),
        ("margins", bench, "--delay-at", "actuator.rate"): ("--delay-at", "write actuator.input"),
        ("margins", bench, "--delay", "0:40ms"): ("--delay", "FROM:TO:COUNT", "'0:40ms'"),
        ("margins", bench, "--delay", "40ms:0:3"): ("--delay", "upwards"),
        ("margins", bench, "--delay", "5deg"): ("--delay", "wrong dimension"),
        ("margins", bench, "--delay", "inf"): ("--delay", "finite"),
        ("margins", bench, "--configuration", "hils"): ("bench.toml", "unknown configuration", "'hils'"),
        ("roots", bench, "--gain", "x"): ("--gain", "not a number", "'x'"),
        ("roots", bench, "--gain", "nan"): ("--gain", "finite"),
        ("roots", bench, "--gain", "2", "--delay", "1ms"): ("one parameter at a time",),
        ("simulate", bench, "--duration", "0"): ("longer than 0 s",),
        ("simulate", bench, "--duration", "1 deg"): ("--duration", "wrong dimension"),
        ("simulate", bench, "--seed", "-1"): ("--seed", "0 or more"),
        ("simulate", bench, "--inputs", bench.parent): ("Is a directory",),
        ("simulate", bench, "--duration", "10ms", "--out", bench.parent): ("cannot be written",),
    }
    for words, parts in cases.items():
        message = said(inside(*words))
        for part in parts:
            assert part in message, message


def test_no_place_to_open_the_loop(inside: Run, bench: Path) -> None:
    bench.write_text(BENCH)
    message = said(inside("margins", bench))
    assert "at which signal" in message and "known: fin_command, fin, rate" in message and "--at" in message


@pytest.mark.parametrize(
    "text, parts",
    [
        ("", ("the file is empty",)),
        ("\x00\x01", ("not a TOML file",)),
        (spoilt('"second_order"', '"secondorder"'), ("blocks.actuator.type", "nearest: second_order")),
        (spoilt("0.6", "-0.6").replace("[900.0]", "900.0"), ("2 faults", "damping", "numerator")),
    ],
    ids=["empty", "binary", "one fault", "two faults"],
)
def test_a_wrong_design(inside: Run, text: str, parts: tuple[str, ...], bench: Path) -> None:
    bench.write_text(text)
    message = said(inside("margins", bench, "--json", "-"))
    for part in (str(bench), *parts):
        assert part in message, message


@pytest.mark.parametrize(
    "content, parts",
    [
        ("", ("the file is empty",)),
        ("time[s],demand[deg]\n0,1\n0.1,nan\n", ("row 3", "column demand")),
        ("time[s],demand[deg]\n0,1\n0.1,2\n0.05,3\n", ("row 4", "column time", "does not increase")),
        ("time[s],demand[s]\n0,1\n0.1,2\n", ("column demand", "wrong dimension", "in deg")),
        ("time[s],demand[deg]\n0,1\n0.1,", ("row 3, column 2 (demand[deg])", "truncated?")),
        ("demand[deg]\n0\n1\n", ("no time column", "known: demand")),
    ],
    ids=["empty", "NaN", "time backwards", "unit", "truncated", "no time"],
)
def test_a_wrong_log(inside: Run, content: str, parts: tuple[str, ...], bench: Path) -> None:
    log = bench.parent / "run.csv"
    log.write_text(content)
    message = said(inside("simulate", bench, "--inputs", log))
    for part in (str(log), *parts):
        assert part in message, message


def test_a_log_with_a_gap_is_accepted_and_said(inside: Run, bench: Path) -> None:
    log = bench.parent / "run.csv"
    log.write_text("time[s],demand[deg]\n0,0\n0.1,1\n0.2,1\n0.7,1\n0.8,0\n")
    done = inside("simulate", bench, "--inputs", log, "--json", "-")
    assert done.returncode == 0 and "1 gap in time" in done.stderr
    assert any("1 gap in time" in note for note in strict(done.stdout)["notes"])


def test_equations_that_run_away_are_said(inside: Run, tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(DRIVEN + DRIVE.replace("(u - viscous*v)/mass", "1 + 1e6*v**3"))
    found = answered(inside, "simulate", path, "--duration", "200ms")
    assert found["diverged"] is not None


# --- interrupted ---


@pytest.mark.parametrize(
    "words",
    [("simulate", "--duration", "20000s", "--out"), ("margins", "--delay", "0:40ms:100000", "--json")],
)
def test_an_interrupted_run_leaves_nothing(words: tuple[str, ...], tmp_path: Path) -> None:
    name, *options = words
    target = tmp_path / "answer"
    line = [sys.executable, "-m", "delaytools.cli", name, str(ROLL), *options, str(target)]
    child = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    time.sleep(2.5)
    assert child.poll() is None, "the run is over before it is interrupted"
    os.kill(child.pid, signal.SIGINT)
    out, err = child.communicate(timeout=60)
    assert child.returncode == 130, (child.returncode, out, err)
    assert err.strip() == "delaytools: interrupted"
    assert list(tmp_path.iterdir()) == []


RELAY_LOOP = """
title = "Relay, lag and delay"
frame = "1 ms"
[signals]
y = "deg"
[blocks.relay]
type = "relay"
input = "-y"
output = "u"
level = 1.0
[blocks.lag]
type = "first_order"
input = "u"
output = "y"
time_constant = "0.1 s"
[analysis]
at = "y"
delay_at = "lag.input"
"""


def test_limit_cycles_of_a_relay(inside: Run, tmp_path: Path) -> None:
    (tmp_path / "relay.toml").write_text(RELAY_LOOP, encoding="utf-8")
    done = inside("limit-cycle", tmp_path / "relay.toml", "--delay", "15ms:100ms:2", "--json", tmp_path / "a.json")
    assert done.returncode == 0 and "agrees: reached from below and from above" in done.stdout
    found = json.loads((tmp_path / "a.json").read_text())["limit_cycles"]
    lasting = [one for one in found if one["stable"]]
    assert [one["delay"] for one in lasting] == [0.015, 0.1]
    assert [round(one["frequency"], 4) for one in lasting] == [17.6223, 3.2289]  # Hz
    assert [round(one["amplitude"], 4) for one in lasting] == [0.1145, 0.5629]
    assert all(one["check"]["agrees"] for one in lasting)


@pytest.mark.parametrize("kind", ["bode", "nichols", "nyquist"])
def test_plots_of_two_configurations(inside: Run, tmp_path: Path, kind: str) -> None:
    picture = tmp_path / "plot.svg"
    both = ("--configuration", "all_digital", "--configuration", "obc_sensor")
    done = inside("plot", ROLL, "--kind", kind, *both, "--out", picture)
    assert done.returncode == 0 and "all_digital, obc_sensor" in done.stdout
    assert picture.read_text(encoding="utf-8").count("<svg") == 1


def test_a_plot_that_cannot_be_drawn_is_refused(inside: Run, tmp_path: Path) -> None:
    refused = {"no such plot": ("--kind", "pie"), "no format": ("--out", "a.xyz"), "too many": ("--delay", "0:1ms:20")}
    for what, words in refused.items():
        done = inside("plot", ROLL, *words)
        assert done.returncode == 2 and what in done.stderr and "Traceback" not in done.stderr


def test_margins_one_signal_at_a_time(inside: Run, tmp_path: Path) -> None:
    target = tmp_path / "a.json"
    words = ("margins", ROLL, "--configuration", "obc_sensor")
    done = inside(*words, "--each", "demanded_fin, feedback_rate", "--json", target)
    assert done.returncode == 0 and "one at a time" in done.stdout
    each = json.loads(target.read_text())["each"]
    alone = inside(*words, "--at", "feedback_rate", "--json", tmp_path / "b.json")
    (known,) = json.loads((tmp_path / "b.json").read_text())["margins"]
    assert alone.returncode == 0 and each["feedback_rate"]["gain_margin"] == known["gain_margin"]
    assert set(each) == {"demanded_fin", "feedback_rate"}


def test_jitter_is_bracketed(inside: Run, tmp_path: Path) -> None:
    done = inside("margins", ROLL, "--delay-rate", "0.3", "--jitter-runs", "--json", tmp_path / "a.json")
    assert done.returncode == 0 and "0.3 s per s" in done.stdout
    found = json.loads((tmp_path / "a.json").read_text())
    assert found["jitter_runs"]["sampling"] == "continuous approximation"
    assert ("lost in a run with" in done.stdout) == (found["jitter_runs"]["frequency"] > 0)
    assert ("no run was lost" in done.stdout) == (found["jitter_runs"]["frequency"] == 0)
    assert found["jitter_margin"] == pytest.approx(found["jitter_runs"]["certain"])
    assert found["jitter_runs"]["certain"] < found["jitter_runs"]["lost"] <= found["margins"][0]["delay_margin"] * 1.01
    assert found["approximation"]["gain_margin"] != found["margins"][0]["gain_margin"]


def test_root_loci_of_a_bench(inside: Run, tmp_path: Path) -> None:
    target = tmp_path / "a.json"
    done = inside("roots", ROLL, "--delay", "0:40ms:2", "--loci", "--json", target)
    assert done.returncode == 0 and "crosses the axis to the right" in done.stdout
    loci = json.loads(target.read_text())["loci"]
    (crossing,) = loci["crossings"]
    asked = inside("margins", ROLL, "--delay", "0:40ms:2", "--json", tmp_path / "m.json")
    assert asked.returncode == 0 and loci["certified"]
    ((_, end),) = json.loads((tmp_path / "m.json").read_text())["stable_delays"]
    assert crossing["value"] == pytest.approx(end, rel=1e-6) and crossing["to_the_right"]
    refused = inside("roots", ROLL, "--loci")
    assert refused.returncode == 2 and "--delay FROM:TO:COUNT" in refused.stderr


@pytest.mark.parametrize(
    "second",
    [("--gain", "0.3:3"), ("--second-delay", "actuator.input=0:40ms"), ("--number", "parameters.kp=0.02:0.12")],
)
def test_stability_maps_of_a_bench(inside: Run, tmp_path: Path, second: tuple[str, str]) -> None:
    picture, target = tmp_path / "map.png", tmp_path / "a.json"
    done = inside("stability-map", ROLL, "--delay", "0:40ms", *second, "--out", picture, "--json", target)
    assert done.returncode == 0 and "% of the plane" in done.stdout and picture.stat().st_size > 10_000
    found = json.loads(target.read_text())
    assert len(found["counts"]) == len(found["grid_y"]) and len(found["counts"][0]) == len(found["grid_x"])
    assert found["curves"] and 0 < found["stable_share"] < 1


@pytest.mark.parametrize(
    ("second", "words"),
    [((), "one second parameter"), (("--gain", "3:1"), "upwards"), (("--number", "x"), "NAME=FROM:TO")],
)
def test_a_plane_that_is_none_is_refused(inside: Run, second: tuple[str, ...], words: str) -> None:
    done = inside("stability-map", ROLL, "--delay", "0:40ms", *second)
    assert done.returncode == 2 and words in done.stderr and "Traceback" not in done.stderr


def test_a_loop_without_limit_cycles_says_why(inside: Run) -> None:
    done = inside("limit-cycle", ROLL, "--no-check")
    assert done.returncode == 0 and "none:" in done.stdout and done.stderr == ""


def test_margins_of_several_signals_gains_and_jitter(inside: Run, tmp_path: Path) -> None:
    target = tmp_path / "a.json"
    words = ("margins", ROLL, "--configuration", "obc_sensor", "--together", "demanded_fin, feedback_rate")
    done = inside(*words, "--json", target)
    assert done.returncode == 0 and "varies at will" in done.stdout
    found = json.loads(target.read_text())
    (margin,) = found["margins"]
    assert found["stable_gains"] == [[0.01, pytest.approx(margin["gain_margin"], rel=1e-9)]]
    assert 0 < found["jitter_margin"] <= margin["delay_margin"]
    disk = found["simultaneous_disk_margin"]
    assert disk["signals"] == ["demanded_fin", "feedback_rate"] and 0 < disk["margin"] < margin["disk_margin"] + 0.05
    wrong = inside("margins", ROLL, "--together", "demanded_fin,stick")
    assert wrong.returncode == 2 and "'stick'" in wrong.stderr


def test_margins_about_a_rest(inside: Run, tmp_path: Path) -> None:
    target = tmp_path / "stiff.toml"
    target.write_text(
        'title = "A stiffening axis"\n[signals]\ndemand = "deg"\nangle = "deg"\n'
        '[blocks.controller]\ntype = "gain"\ninput = "20*(demand - angle) - 6*rate"\noutput = "torque"\n'
        '[blocks.axis]\ntype = "equations"\ninputs = { u = "torque" }\nstates = { q = 0.0, v = 0.0 }\n'
        'rates = { q = "v", v = "u - 4*q - 0.5*q**3" }\noutputs = { angle = "q", rate = "v" }\n'
    )
    level = answered(inside, "margins", target, "--at", "torque")
    done = inside("margins", target, "--at", "torque", "--hold", "demand = 2.6 deg", "--json", tmp_path / "a.json")
    assert "about the rest at demand 2.6 deg, torque 12, angle 2 deg" in done.stdout
    held = strict((tmp_path / "a.json").read_text())
    assert held["operating_point"]["angle"] == pytest.approx(2.0) and "operating_point" not in level
    assert held["margins"][0]["delay_margin"] < level["margins"][0]["delay_margin"]
    for command_ in ("roots", "limit-cycle"):
        assert answered(inside, command_, target, "--at", "torque", "--hold", "demand=2.6")
    for wrong, part in (("dmand=1", "nearest: demand"), ("demand", "NAME=2"), ("demand=2 m", "--hold demand")):
        assert part in said(inside("margins", target, "--at", "torque", "--hold", wrong))
