"""Several inputs and outputs of one FMU: an arm in C with a command and a load, a tip and a force."""

import json
import shlex
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from few import few_rows
from foreign_fmus import ARM_FORCE_N, ARM_TIP_mm, arm_fmu, needs_compiler

from bender_cli.main import main
from bender_discrepancy.conclusion.findings import RecalibratedNumber
from bender_discrepancy.foreign import outputs, outputs_report
from bender_discrepancy.foreign.joint_explanations import (
    NOTHING,
    Correction,
    Output,
    OutputResidual,
    rank_explanations,
)
from bender_discrepancy.foreign.outputs import Together
from bender_discrepancy.foreign.outputs_report import factors, joint_numbers, sentence, summary, titles
from bender_inference.fitting.journal import UNFINISHED, current_journal
from bender_inference.search.result import Interrupted
from bender_loop.errors import RunError
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.drive import drive_record
from bender_loop.records.record import read_record
from bender_loop.records.replay import replay
from bender_loop.shell.run import say_held
from bender_loop.tables.quantities import USUAL, Quantities
from bender_plant.model import load_model
from bender_report.number import Number
from bender_report.wording import IN_WORDS

pytestmark = needs_compiler
STEP_S, ROWS, LATE = 0.02, 1200, 3
TIP_NOISE_mm, FORCE_NOISE_N = 0.004, 0.003
TWO = ["--input", "command", "--output", "tip", "--output", "force"]


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("foreign") / "arm.fmu"
    return arm_fmu(path)


def levels(rng: np.random.Generator, amplitude: float, rows: int) -> np.ndarray:
    found = np.repeat(rng.uniform(-amplitude, amplitude, ROWS // rows), rows)
    found[:rows] = 0.0
    return found


def answer(command: np.ndarray, load: np.ndarray, numbers: tuple[float, float, float]) -> np.ndarray:
    """The lag of both inputs in closed form, read before the levels of a row act."""
    lag_s, per_V, per_N = numbers
    keep, found = np.exp(-STEP_S / lag_s), np.zeros(ROWS)
    found[0] = per_N * load[0]
    for k in range(1, ROWS):
        found[k] = keep * found[k - 1] + (1.0 - keep) * (per_V * command[k - 1] + per_N * load[k - 1])
    return found


def with_play(values: np.ndarray, half_width: float) -> np.ndarray:
    found, place = np.zeros(values.size), 0.0
    for k, value in enumerate(values):
        place = min(max(place, value - half_width), value + half_width)
        found[k] = place
    return found


def write(path: Path, late: tuple[int, int], *, load_N: float = 0.0, play_N: float = 0.0, seed: int = 1) -> Path:
    rng = np.random.default_rng(seed)
    command, load = levels(rng, 40.0, 15), load_N * levels(rng, 1.0, 40)
    shifted = [np.concatenate([np.zeros(x), command[: ROWS - x]]) for x in late]
    tip = answer(shifted[0], load, ARM_TIP_mm) + TIP_NOISE_mm * rng.standard_normal(ROWS)
    force = with_play(answer(shifted[1], load, ARM_FORCE_N), play_N) + FORCE_NOISE_N * rng.standard_normal(ROWS)
    rows = np.column_stack([STEP_S * np.arange(ROWS), command, load, tip, force])
    head = "time [s],command [V],load [N],tip [mm],force [N]"
    np.savetxt(path, rows, fmt="%.17g", delimiter=",", header=head, comments="")
    return path


@pytest.mark.slow
def test_what_acts_on_the_input_is_told_from_what_acts_on_one_output(
    arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record, out = write(tmp_path / "record.csv", (LATE, LATE), play_N=0.08), tmp_path / "out"
    assert main(["diagnose", str(record), "--fmu", str(arm), *TWO, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "transport delay on the input, which all outputs share; backlash on force alone" in said
    found = json.loads((out / "outputs.json").read_text(encoding="utf-8"))
    assert (found["verdict"], found["input"]["effects"]) == ("named", ["transport_delay"])
    assert found["input"]["parameters"]["transport_delay.delay"] == pytest.approx(LATE * STEP_S, abs=2e-4)
    assert [found["outputs"][x]["on_this_output_alone"] for x in ("tip", "force")] == [[], ["backlash"]]
    for name, noise in (("tip", 1e3 * TIP_NOISE_mm), ("force", 1e3 * FORCE_NOISE_N)):
        assert found["outputs"][name]["gap"]["together"] == pytest.approx(noise, rel=0.15)
        assert (out / name / "report.html").exists()
    assert "report of force" in (out / "report.html").read_text(encoding="utf-8")
    _the_corrected_fmu_meets_both_records(out / "model.fmu", record)


def _the_corrected_fmu_meets_both_records(fmu: Path, path: Path) -> None:
    for output, noise in (("tip", 1e3 * TIP_NOISE_mm), ("force", 1e3 * FORCE_NOISE_N)):
        record = read_record(path, reading=output)
        with FmuPlant(fmu, input_name="command", output_name=output, quantities=record.quantities) as plant:
            left = record.displacement_um - drive_record(plant, record)
        assert np.std(left[10:]) == pytest.approx(noise, rel=0.2)


@pytest.mark.slow
def test_a_delay_of_one_output_is_not_put_on_the_input(arm: Path, tmp_path: Path) -> None:
    record, out = write(tmp_path / "record.csv", (LATE, 0)), tmp_path / "out"
    assert main(["diagnose", str(record), "--fmu", str(arm), *TWO, "--out", str(out)]) == 0
    found = json.loads((out / "outputs.json").read_text(encoding="utf-8"))
    assert found["input"]["each_by_itself"]
    assert [found["outputs"][x]["on_this_output_alone"] for x in ("tip", "force")] == [["transport_delay"], []]
    assert found["fmu"] is None
    assert not (out / "model.fmu").exists()
    assert (out / "tip" / "model.fmu").exists()


@pytest.mark.parametrize("moved_s", [0.0, 5.0])
def test_a_further_input_acts_from_its_row_on(arm: Path, tmp_path: Path, moved_s: float) -> None:
    path = write(tmp_path / "record.csv", (0, 0), load_N=1.0, seed=3)
    text = path.read_text(encoding="utf-8").splitlines()
    rows = np.array([[float(x) for x in line.split(",")] for line in text[1:]])
    rows[:, 0] += moved_s
    np.savetxt(path, rows, fmt="%.17g", delimiter=",", header=text[0], comments="")
    record = read_record(path, reading="tip", further={"load": "load"})
    assert record.further[0].unit == "N"
    exact_um = 1e3 * answer(rows[:, 1], rows[:, 2], ARM_TIP_mm)
    with FmuPlant(arm, input_name="command", output_name="tip") as plant:
        driven = replay(plant, record).simulated_um
        np.testing.assert_allclose(driven, exact_um, atol=1e-6)
        # the next record has no load: the FMU's own start value holds again
        still = read_record(path, reading="tip")
        no_load_um = 1e3 * answer(rows[:, 1], 0.0 * rows[:, 2], ARM_TIP_mm)
        np.testing.assert_allclose(drive_record(plant, still), no_load_um, atol=1e-6)


def test_a_further_input_is_at_its_first_value_at_the_start(arm: Path, tmp_path: Path) -> None:
    path = write(tmp_path / "record.csv", (0, 0))
    lines = path.read_text(encoding="utf-8").splitlines()
    lines[1:] = [",".join([*x.split(",")[:2], "2.0", *x.split(",")[3:]]) for x in lines[1:]]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    record = read_record(path, reading="force", further={"load": "load"})
    quantities = Quantities("V", "N")
    with FmuPlant(arm, input_name="command", output_name="force", quantities=quantities) as plant:
        assert drive_record(plant, record)[0] == pytest.approx(2.0 * ARM_FORCE_N[2])


@pytest.mark.parametrize(
    ("words", "complaint"),
    few_rows(
        [
            (["--output", "tip", "--output", "tip"], "--output: found 'tip' twice, expected each variable once"),
            (["--output", "tip", "--output", "="], "--output: found '=', expected NAME or NAME=COLUMN"),
            (["--output", "tip", "--output", "torque"], "found no variable 'torque'"),
            (["--output", "tip", "--output", "force", "--suspect", "load"], "found 'load', expected a real parameter"),
            (["--output", "tip", "--further-input", "heat=load"], "found no variable 'heat'"),
            (["--output", "tip", "--further-input", "command"], "takes the command, expected another input"),
            (["--output", "tip", "--further-input", "load=weight"], "--further-input load=COLUMN"),
            (["--output", "tip", "--further-input", "load", "--untimed"], "whose times are known"),
            (["--output", "tip=force"], "tip: unit: found 'mm' where 'mN' is needed, another quantity"),
        ],
        0,
        1,
        2,
    ),
)
def test_what_cannot_be_weighed_together(
    arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], complaint: str
) -> None:
    record, out = write(tmp_path / "record.csv", (0, 0)), tmp_path / "out"
    begin = ["diagnose", str(record), "--fmu", str(arm), "--input", "command"]
    assert main([*begin, *words, "--out", str(out)]) == 2
    assert complaint in capsys.readouterr().err
    assert not out.exists()


def test_several_outputs_and_further_inputs_need_an_fmu(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = write(tmp_path / "record.csv", (0, 0))
    assert main(["diagnose", str(record), "--output", "tip", "--output", "force"]) == 2
    assert "--fmu" in capsys.readouterr().err
    assert main(["compare", str(record), "--further-input", "load"]) == 2
    assert "--further-input: found without --fmu" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["compare", "watch"])
def test_a_recorded_input_that_nothing_drives_is_not_passed_over_in_silence(
    arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    record, out = write(tmp_path / "record.csv", (0, 0), load_N=1.0), tmp_path / "out"
    columns = ["--columns", "time [s],command [V],tip [mm]", "--units", "s,V,mm"]
    of = {"compare": [str(record), "--fmu", str(arm)], "watch": [str(arm), str(record), "--replay", "--learn", "600"]}
    words = [command, *of[command], "--input", "command", "--output", "tip", "--out", str(out)]
    assert main([*words, *(columns if command == "watch" else [])]) in (0, 3)
    said = "load of the FMU stays at 0; the record has a column of that name"
    assert capsys.readouterr().err.count(said) == 1
    for driven in (["--further-input", "load"], ["--set", "load=2"]) if command == "compare" else ():
        assert main([*words, *driven]) == 0
        assert said not in capsys.readouterr().err


def test_several_outputs_tell_of_an_input_that_nothing_drives_once(
    arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken_off(*_: object) -> None:
        say_held()
        raise RunError("enough")

    monkeypatch.setattr("bender_discrepancy.foreign.outputs.diagnose_outputs", broken_off)
    record = write(tmp_path / "record.csv", (0, 0), load_N=1.0)
    assert main(["diagnose", str(record), "--fmu", str(arm), *TWO, "--out", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err.count("that name: --further-input load") == 1


@pytest.mark.parametrize(
    "begin",
    [
        ["compare", "r.csv", "--fmu", "f.fmu"],
        ["calibrate-model", "r.csv", "--fmu", "f.fmu"],
        ["watch", "f.fmu", "r.csv"],
        ["tune", "--fmu", "f.fmu"],
        ["simulate", "f.fmu", "--gains", "gains.toml"],
        ["fmu", "linearise", "--fmu", "f.fmu"],
        ["fleet", "diagnose", "r.csv", "--fmu", "f.fmu"],
    ],
)
def test_a_command_of_one_output_refuses_two(begin: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*begin, "--output", "tip", "--output", "force"]) == 2
    assert "--output: found 'force' beside 'tip', expected one output at a time" in capsys.readouterr().err


MODEL = load_model("beam")


class _WithCorrections(Output):
    """An output whose diagnosis is not looked at."""

    @property
    def name(self) -> str:
        return str(self.original)

    @property
    def rows(self) -> float:
        return 500.0

    @property
    def numbers(self) -> dict[tuple[str, str], tuple[float, float]]:
        return {}


BESIDE = ("transport_delay", "delay_s"), ("sensor_lag", "time_constant_s")


def _output(name: str, before: Correction, behind: Correction = NOTHING) -> Output:
    kinds = (behind,) if behind is NOTHING else (behind, NOTHING)
    return _WithCorrections(None, name, (before,), kinds)  # type: ignore[arg-type]


def test_what_one_output_has_beside_what_all_share_is_its_own() -> None:
    """The second finds the delay of the first and a slew limit, which is no matter of the input then."""
    delay = Correction(("transport_delay",), MODEL, 1)
    both = Correction(("transport_delay", "slew_limit"), MODEL, 2)
    outputs = [_output("a", delay), _output("b", both)]
    costs = {("a", 0): 900.0, ("a", 1): -100.0, ("a", 2): 700.0, ("b", 0): 900.0, ("b", 1): 300.0, ("b", 2): -100.0}
    left = {(name, place, 0): OutputResidual(cost, 1.0) for (name, place), cost in costs.items()}
    found = rank_explanations(outputs, left, {x: OutputResidual(-100.0, 1.0) for x in "ab"}, 0.99).best
    assert (found.each, found.effects, found.apart) == (False, {"transport_delay"}, {"b"})
    assert found.behind["b"].effects == ("slew_limit",)


def test_what_acts_inside_the_fmu_is_missing_although_it_stands_on_no_side() -> None:
    outputs = [_output("a", NOTHING), _output("b", NOTHING)]
    found = rank_explanations(
        outputs,
        {(x, 0, 0): OutputResidual(-100.0, 1.0) for x in "ab"},
        {x: OutputResidual(-100.0, 1.0) for x in "ab"},
        0.99,
    )
    still = SimpleNamespace(recalibrated=())
    alone = {
        "a": SimpleNamespace(
            verdict="named",
            added=(SimpleNamespace(id="tip_mass"),),
            is_complete=True,
            model=load_model("paper"),
            findings=still,
            quantities=USUAL,
        ),
        "b": SimpleNamespace(verdict="no_gap", added=(), is_complete=True, findings=still, quantities=USUAL),
    }
    told = Together(alone, found, {}, {})  # type: ignore[arg-type]
    assert told.inside == {"a": ("tip_mass",)}
    assert told.verdict == "named"
    assert sentence(told) == f"Missing from the model: {titles(('tip_mass',))} inside the FMU, as a shows."


def test_the_terminal_has_the_numbers_of_what_was_found_and_what_is_left_in_words_of_the_device() -> None:
    delay = Correction(("transport_delay",), MODEL.with_block("transport_delay", delay_s=14.0), 1)
    lag = Correction(("second_mode",), MODEL.with_block("second_mode", share=0.3), 1)
    outputs = [_output("plate", delay), _output("air", NOTHING, lag)]
    left = {
        (name, place, k): OutputResidual(500.0, 1.0) for name in ("plate", "air") for place in (0, 1) for k in (0, 1)
    }
    left |= {("plate", 1, 0): OutputResidual(-900.0, 1.0), ("air", 1, 0): OutputResidual(-900.0, 1.0)}
    ranked = rank_explanations(outputs, left, {x: OutputResidual(400.0, 1.0) for x in ("plate", "air")}, 0.99)
    assert ranked.best.effects == {"transport_delay"}
    shared = SimpleNamespace(
        id="transport_delay", numbers=[Number("delay_s", 14.2, "s", std=0.3, interval=(13.6, 14.8))]
    )
    oven = {
        "verdict": "named", "model": MODEL, "effects": [shared], "findings": SimpleNamespace(recalibrated=()),
        "quantities": Quantities("W", "K"),
        "gap": SimpleNamespace(
            recalibrated=SimpleNamespace(rms_um=2.0), after=SimpleNamespace(rms_um=1.0), floor_um=0.05
        ),
    }  # fmt: skip
    alone = {
        "plate": SimpleNamespace(**oven, added=(shared,), is_complete=True),
        "air": SimpleNamespace(**oven, added=(), is_complete=False),
    }
    told = Together(alone, ranked, {}, {"plate": 0.07, "air": 0.34})  # type: ignore[arg-type]
    lines = summary(told)
    assert lines[0].startswith(f"named{'' if told.complete else ', not complete'}: ")
    assert (
        "transport delay: delay 14.20 ± 0.60 s, acts on the input, which all outputs share (by the readings of plate)"
        in lines
    )
    assert IN_WORDS in lines
    assert "left with all outputs together: plate 0.07 K (noise 0.05 K), air 0.34 K (noise 0.05 K)" in lines
    assert outputs_report._titles(told, ("second_mode",)) == "a second mode"
    assert titles(("second_mode",)) == "a second mode"


def test_the_page_has_no_rows_of_what_is_not_needed_with_all_outputs_together() -> None:
    delay = Correction(("transport_delay",), MODEL.with_block("transport_delay", delay_s=0.06), 1)
    outputs = [_output("a", delay), _output("b", NOTHING)]
    left = {(x, k, 0): OutputResidual(-900.0 if k else 500.0, 1.0) for x in ("a", "b") for k in (0, 1)}
    ranked = rank_explanations(outputs, left, {x: OutputResidual(400.0, 1.0) for x in ("a", "b")}, 0.99)
    found = [SimpleNamespace(id=x, numbers=[Number(n, 0.06, "s")]) for x, n in BESIDE]
    gap = SimpleNamespace(recalibrated=SimpleNamespace(rms_um=2.0), after=SimpleNamespace(rms_um=1.0), floor_um=0.05)
    own = {"verdict": "named", "is_complete": True, "quantities": USUAL, "gap": gap, "model": MODEL}
    findings = SimpleNamespace(recalibrated=())
    alone = {"a": SimpleNamespace(**own, added=found, findings=findings)}
    alone["b"] = SimpleNamespace(**own, added=(), findings=findings)
    sections = outputs_report.page(Together(alone, ranked, {}, {}), {"a": "a", "b": "b"}).sections  # type: ignore[arg-type]
    (table,) = [x.table for x in sections if x.table is not None and "acts on" in x.table.columns]
    assert [row[0] for row in table.rows] == ["transport delay"]


class _WithDelay(_WithCorrections):
    """An output that found a delay with a standard deviation of 1 ms."""

    @property
    def numbers(self) -> dict[tuple[str, str], tuple[float, float]]:
        return {("transport_delay", "delay_s"): ({"a": 0.060, "b": 0.059, "c": 0.080}[self.name], 1e6)}


@pytest.mark.parametrize(("other", "each"), [("b", False), ("c", True)])
def test_outputs_that_found_the_same_numbers_have_no_corrections_of_their_own(other: str, each: bool) -> None:
    """Whatever a residual that nobody explains makes of the criterion."""
    delay = Correction(("transport_delay",), MODEL.with_block("transport_delay", delay_s=0.06), 1)
    outputs = [_WithDelay(None, x, (delay,), (NOTHING,)) for x in ("a", other)]  # type: ignore[arg-type]
    left = {(x, place, 0): OutputResidual(-100.0, 1.0) for x in ("a", other) for place in range(4)}
    own = {x: OutputResidual(-200.0, 1.0) for x in ("a", other)}
    apart = [x for x in rank_explanations(outputs, left, own, 0.99).ways if x.each]
    assert bool(apart) is each


def test_a_way_has_to_be_better_by_more_than_chance() -> None:
    """Where an output sees neither good nor harm of a correction of the input, one for all is the simpler word."""
    outputs = [_output("a", NOTHING), _output("b", NOTHING)]
    left = {(x, 0, 0): OutputResidual(-100.0, 1.0) for x in "ab"}
    for gain, each in ((5.0, False), (50.0, True)):
        own = {"a": OutputResidual(-100.0 - gain, 1.0), "b": OutputResidual(-100.0, 1.0)}
        found = rank_explanations(outputs, left, own, 0.99)
        assert found.best.each is each
        assert found.rivals() == ()
        assert found.threshold == pytest.approx(9.2103, abs=1e-3)


def test_what_an_output_has_inside_by_itself_is_no_matter_where_something_around_the_fmu_explains_it() -> None:
    outputs = [_output("a", NOTHING), _output("b", NOTHING)]
    found = rank_explanations(
        outputs,
        {(x, 0, 0): OutputResidual(-100.0, 1.0) for x in "ab"},
        {x: OutputResidual(-100.0, 1.0) for x in "ab"},
        0.99,
    )
    one = SimpleNamespace(added=(SimpleNamespace(id="tip_mass"),), model=load_model("paper"))
    told = Together({"a": one, "b": one}, found, {}, {}, needing_inside=frozenset("b"))  # type: ignore[arg-type]
    assert told.inside == {"b": ("tip_mass",)}


class _Diagnosed:
    """The diagnosis of one output."""

    def __init__(self, text: str) -> None:
        self._text = text

    def write(self, folder: Path) -> None:
        (folder / "diagnosis.json").write_text(self._text, encoding="utf-8")


@pytest.fixture
def words(arm: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    record = tmp_path / "record.csv"
    rows = np.column_stack([0.02 * np.arange(100), *np.random.default_rng(1).standard_normal((3, 100))])
    head = "time [s],command [V],tip [mm],force [N]"
    np.savetxt(record, rows, fmt="%.9g", delimiter=",", header=head, comments="")
    monkeypatch.setattr(outputs_report, "write", lambda _found, _folders, out: (out / "outputs.json").write_text("{}"))
    monkeypatch.setattr(outputs_report, "summary", lambda _found: ["named"])
    return ["diagnose", str(record), "--fmu", str(arm), *TWO]


def _told(monkeypatch: pytest.MonkeyPatch, function: Callable[[Callable[..., None]], object]) -> None:
    """Let a function of `keep` stand for the diagnosis."""
    monkeypatch.setattr(outputs, "diagnose_outputs", lambda *given: function(given[-2]))


@pytest.mark.parametrize("complete", [[], ["tip"]])
def test_what_an_interrupt_advises_works(
    words: list[str],
    complete: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"

    def interrupted(keep: Callable[..., None]) -> None:
        journal = current_journal()
        assert journal is not None
        journal.entries["fit"] = [1.0]
        for name in complete:
            keep(name, _Diagnosed("first"))
        raise Interrupted(SimpleNamespace())  # type: ignore[arg-type]

    _told(monkeypatch, interrupted)
    assert main([*words, "--out", str(out)]) == 130
    assert (
        f"go on with: {shlex.join(['bender', *words, '--out', str(out), '--resume', str(out)])}"
        in capsys.readouterr().err
    )
    assert {x.name for x in out.iterdir()} == {*complete, UNFINISHED}

    def ended(keep: Callable[..., None]) -> object:
        journal = current_journal()
        assert journal is not None
        assert journal.recall("fit") == [1.0]
        for name in ("tip", "force"):
            keep(name, _Diagnosed("again"))
        return SimpleNamespace()

    _told(monkeypatch, ended)
    assert main([*words, "--resume", str(out)]) == 0
    assert {x.name for x in out.iterdir()} == {"tip", "force", "outputs.json"}
    assert (out / "tip" / "diagnosis.json").read_text(encoding="utf-8") == "again"


def test_without_resume_an_earlier_diagnosis_stays(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out" / "tip").mkdir(parents=True)
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    assert "is there already; choose another --out" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("other", "told"),
    [
        (0.9204, ["every output reads 0.9204 times as much, as if the input did"]),
        (0.97, ["the sensor of a reads 0.9208 times as much", "the sensor of b reads 0.97 times as much"]),
        (None, ["the sensor of a reads 0.9208 times as much"]),
    ],
)
def test_a_factor_that_all_outputs_share_is_not_told_as_one_of_every_sensor(
    other: float | None, told: list[str]
) -> None:
    gains = {"a": RecalibratedNumber("gain", 1.0, 0.9208, 3e-4, "1")}
    if other is not None:
        gains["b"] = RecalibratedNumber("gain", 1.0, other, 1e-4, "1")
    assert factors(gains, 2) == told


@pytest.mark.parametrize(
    ("after", "acting", "refused"),
    [(0.0505, (), False), (0.0783, (), False), (0.0783, ("sensor_lag",), True), (2.5, (), True)],
)
def test_steps_of_the_corrected_fmu_may_change_an_output_on_which_nothing_acts(
    after: float, acting: tuple[str, ...], refused: bool
) -> None:
    """Two outputs of an oven; its readings span 400 K, of which 0.5 % matter."""
    span = SimpleNamespace(measured_um=np.array([293.0, 693.0]), reporting=np.array([True, True]))
    search = SimpleNamespace(settings=SimpleNamespace(relevant=0.005), whole=[span])
    diagnosis = SimpleNamespace(
        findings=SimpleNamespace(search=search), gap=SimpleNamespace(recalibrated=SimpleNamespace(rms_um=0.051))
    )
    output = SimpleNamespace(name="chamber", diagnosis=diagnosis, floor=0.05)
    way = SimpleNamespace(effects=frozenset(), behind={"chamber": Correction(acting, MODEL, 1)})
    more = outputs._spoilt(output, after)  # type: ignore[arg-type]
    assert (more > outputs._allowed(output, way)) == refused  # type: ignore[arg-type]


def test_what_only_all_outputs_together_name_has_its_numbers() -> None:
    lag = load_model("beam").with_block("sensor_lag", time_constant_s=60.0)
    best = SimpleNamespace(each=False, behind={"wall": Correction(("sensor_lag",), lag, 1), "chamber": NOTHING})
    alone = SimpleNamespace(added=(), quantities=Quantities("W", "K"))
    told = SimpleNamespace(best=best, by_itself={"wall": alone, "chamber": alone})
    [(effect, number)] = joint_numbers(told, "wall")  # type: ignore[arg-type]
    assert (effect, number.name, number.value, number.unit) == ("sensor_lag", "time_constant_s", 60.0, "s")
    assert joint_numbers(told, "chamber") == []  # type: ignore[arg-type]
    rows = outputs_report._joint_rows(told, "wall", alone)  # type: ignore[arg-type]
    assert [x[2:] for x in rows] == [["60 s", "all outputs together", "wall alone"]]
    alone.added = (SimpleNamespace(id="sensor_lag"),)
    assert joint_numbers(told, "wall") == []  # type: ignore[arg-type]
