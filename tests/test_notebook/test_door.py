"""The notebook's door: the same answers and the same refusals as the command line, results that save and draw."""

import inspect
import json
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from foreign_fmus import foreign_fmu, needs_compiler
from matplotlib.figure import Figure
from reported_diagnosis import levels, record_of

import piezo_bender as pb
from bender_cli.main import main
from bender_export.archive import unpacked
from bender_loop.control.pid import Gains
from bender_loop.records.record import Record, write_record
from piezo_bender.comparisons import model_words
from piezo_bender.shared import options_as_arguments

# patient with a machine that does other things at the same time
PATIENT = "[emulator]\n[guard]\nheartbeat_s = 1.0\nframe_age_s = 1.0\n"
LAG = {"source_resistance": {"time_constant_s": 0.08}}


@pytest.fixture(scope="module")
def lagging() -> Record:
    return record_of(effects=LAG, voltage_V=levels(12.0))


@pytest.fixture(scope="module")
def found(lagging: Record) -> pb.Diagnosis:
    return pb.diagnose(lagging)


def axes():
    return Figure().subplots()


def assert_it_draws_and_tells_itself(result):
    drawn = axes()
    assert result.plot(drawn) is drawn
    assert len(result.to_frame())
    assert "\n" not in repr(result)
    assert "<table>" in result._repr_html_()


def columns(record: Record) -> dict[str, np.ndarray]:
    return {"time_s": record.time_s, "voltage_V": record.voltage_V, "displacement_um": record.displacement_um}


def load_arrays(x: Record) -> pb.LoadedRecord:
    return pb.load_record(time_s=x.time_s, voltage_V=x.voltage_V, displacement_um=x.displacement_um)


def test_importing_it_imports_nothing_heavy():
    heavy = "numpy", "scipy", "matplotlib", "numba", "pandas", "jinja2"
    code = f"import sys, piezo_bender; print([x for x in {heavy!r} if x in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_promised_name_is_there():
    for name in pb.__all__:
        assert getattr(pb, name) is not None
    with pytest.raises(AttributeError, match="nonsense"):
        _ = pb.nonsense  # pyright: ignore[reportAttributeAccessIssue]


def test_a_record_is_the_same_from_file_frame_and_arrays(lagging: Record, tmp_path: Path):
    write_record(tmp_path / "one.csv", lagging)
    frame = pd.DataFrame({"t": 1e3 * lagging.time_s, "U": lagging.voltage_V, "d": 1e-3 * lagging.displacement_um})
    from_frame = pb.load_record(frame, "time=t,voltage=U,displacement=d", "ms,V,mm")
    for x in (pb.load_record(tmp_path / "one.csv"), pb.load_record(columns(lagging)), from_frame):
        assert x.time_s == pytest.approx(lagging.time_s)
        assert x.displacement_um == pytest.approx(lagging.displacement_um, rel=1e-12)
    assert load_arrays(lagging).to_frame().shape == (len(lagging), 3)


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        ({"time_s": [0.0, 1.0], "voltage_V": [0.0, 1.0]}, "column displacement_um: no such column"),
        ({"time_s": [0.0, 1.0], "voltage_V": [0.0], "displacement_um": [0.0, 1.0]}, "expected one length"),
        ({"time_s": [1.0, 0.0], "voltage_V": [0.0, 1.0], "displacement_um": [0.0, 1.0]}, "row 1, column time_s"),
        ({"time_s": ["a", 0.0], "voltage_V": [0.0, 1.0], "displacement_um": [0.0, 1.0]}, "row 0, column time_s"),
        (7, "found an int"),
    ],
)
def test_a_bad_record_is_refused(bad: object, said: str):
    with pytest.raises(pb.InputError, match=said) as refused:
        pb.load_record(bad)  # pyright: ignore[reportArgumentType]
    assert isinstance(refused.value, ValueError)


def sentence_of(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    capsys.readouterr()
    assert main(words) == 2
    return capsys.readouterr().err.strip().removeprefix("bender: ")


def still(folder: Path) -> Path:
    write_record(folder / "still.csv", Record(np.arange(60.0), np.full(60, 5.0), np.arange(60.0)))
    return folder / "still.csv"


def short(folder: Path) -> Path:
    write_record(folder / "short.csv", Record(np.arange(9.0), np.arange(9.0), np.arange(9.0)))
    return folder / "short.csv"


def broken(folder: Path) -> Path:
    (folder / "broken.csv").write_text("time_s,voltage_V,displacement_um\n0,0,0\n1,x,0\n", encoding="utf-8")
    return folder / "broken.csv"


@pytest.mark.parametrize("command", ["diagnose", "compare"])
@pytest.mark.parametrize("make", [still, short, broken, lambda folder: folder / "absent.csv"])
def test_bad_input_is_refused_with_the_sentence_of_the_command_line(
    command: str, make, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    path = make(tmp_path)
    if command == "compare" and path.stem in ("still", "short"):
        pytest.skip("compare takes it")
    before = set(tmp_path.rglob("*"))
    said = sentence_of([command, str(path)], capsys)
    with pytest.raises(pb.InputError) as refused:
        getattr(pb, command)(path)
    assert str(refused.value) == options_as_arguments(said)
    assert set(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: pb.load_model("nowhere.toml"), ["diagnose", "x.csv", "--model", "nowhere.toml"]),
        (lambda: pb.effects("crep"), ["effects", "crep"]),
        (lambda: pb.tune("paper", fmu="x.fmu"), ["tune", "--model", "paper", "--fmu", "x.fmu"]),
        (lambda: pb.compare("x.csv", "paper", fmu="x.fmu"), ["compare", "x.csv", "--model", "paper", "--fmu", "x.fmu"]),
        (lambda: pb.tune(method="magic"), ["tune", "--method", "magic"]),
        (lambda: pb.run_bench("absent.toml"), ["hil", "--bench", "absent.toml"]),
        (lambda: pb.identify("absent.csv"), ["identify", "absent.csv"]),
    ],
)
def test_other_refusals_are_those_of_the_command_line(
    call, words: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    said = sentence_of(words, capsys)
    with pytest.raises(pb.InputError) as refused:
        call()
    assert str(refused.value) == options_as_arguments(said)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "call",
    [
        lambda: pb.diagnose({"time_s": [0, 1]}, input_hold="cubic"),
        lambda: pb.diagnose([]),
        lambda: pb.tune(speed=3),
        lambda: pb.identify([], plays=3),
        lambda: pb.load_record(),
        lambda: pb.load_model("paper").with_block("creep", nonsense=1.0),
    ],
)
def test_what_only_a_program_can_get_wrong_is_refused_too(call):
    with pytest.raises(pb.InputError):
        call()


@pytest.mark.slow
def test_a_diagnosis_is_that_of_the_command(
    lagging: Record, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    write_record(tmp_path / "one.csv", lagging)
    assert main(["diagnose", "one.csv", "--out", "command", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    files = told.pop("sha256")
    steps: list[str] = []
    found = pb.diagnose("one.csv", progress=steps.append)
    assert told.pop("provenance")["command"] == "bender diagnose one.csv --out command --json"
    assert found.to_dict() == told
    assert found.verdict == "named"
    assert "driving the corrected FMU" in steps
    found.save("door")
    saved = json.loads(Path("door/diagnosis.json").read_text(encoding="utf-8"))
    assert saved.pop("provenance")["command"] is None
    assert saved.pop("sha256").keys() == files.keys()
    assert saved == told
    assert Path("door/model.toml").read_bytes() == Path("command/model.toml").read_bytes()
    door, command = (unpacked(Path(x) / "model.fmu") for x in ("door", "command"))
    # the report says which command made it
    assert door.keys() == command.keys()
    assert {x for x in door if door[x] != command[x]} <= {"documentation/report.html"}
    assert {x.name for x in Path("door").iterdir()} == {x.name for x in Path("command").iterdir()}


@pytest.mark.slow
def test_readings_in_steps_have_one_verdict_everywhere(tmp_path: Path):
    fine = record_of("beam", voltage_V=levels(15.0))
    coarse = Record(fine.time_s, fine.voltage_V, 1.5 * np.round(fine.displacement_um / 1.5))
    found = pb.diagnose(coarse, "beam")
    told = json.loads((found.save(tmp_path / "out") / "diagnosis.json").read_text(encoding="utf-8"))
    assert found.verdict == told["verdict"] == "named"
    assert [x.id for x in found.effects] == [x["id"] for x in told["effects"]] == ["sensor_quantisation"]
    # what the search alone would have said is not told anywhere
    assert found.findings.search.verdict.word in ("no_gap", "recalibrated")
    assert found.reason == told["reason"] != found.findings.search.verdict.reason
    assert repr(found).startswith("<Diagnosis named: sensor_quantisation (1.00);")


@pytest.mark.slow
def test_a_diagnosis_pickles_whole(found: pb.Diagnosis, tmp_path: Path):
    again = pickle.loads(pickle.dumps(found))
    assert again.to_dict() == found.to_dict()
    assert again.model == found.model
    assert type(again) is type(found)
    assert {x.name for x in again.save(tmp_path).iterdir()} >= {"report.html", "model.fmu", "diagnosis.json"}
    assert again.plot(axes()) is not None


@pytest.mark.slow
def test_the_table_of_a_diagnosis_leaves_nothing_out(found: pb.Diagnosis):
    frame, told = found.to_frame(), found.to_dict()
    numbers = [(x["id"], name) for x in told["effects"] for name in x["parameters"]]
    numbers += [("recalibrated", x.name) for x in found.findings.changed]
    assert set(told["recalibrated"]) <= set(frame["parameter"])
    rows = frame[frame["effect"] == "recalibrated"]
    before, after = found.findings.search.base.values(), found.model.model.values()
    changed = {x for x in ("gain", "offset") if after.get(f"calibration.{x}") != before.get(f"calibration.{x}")}
    assert changed <= set(rows["parameter"])
    low, value, high, std = (np.asarray(rows[x], dtype=float) for x in ("low_95", "value", "high_95", "std"))
    assert np.array_equal(np.isnan(low), np.isnan(std))
    assert np.all(np.isnan(std) | ((low < value) & (value < high)))
    assert list(zip(frame["effect"], frame["parameter"], strict=True)) == numbers
    (_, row), *_ = frame.iterrows()
    parameter = told["effects"][0]["parameters"][row["parameter"]]
    assert [row["low_95"], row["high_95"]] == parameter["interval_95"]
    assert (row["grade"], row["probability"]) == (told["effects"][0]["grade"], told["effects"][0]["probability"])


@pytest.mark.slow
def test_an_effect_says_what_the_file_says_of_it(found: pb.Diagnosis):
    for effect, told in zip(found.effects, found.to_dict()["effects"], strict=True):
        assert (effect.id, effect.stage) == (told["id"], told["stage"])
        assert (round(effect.share_of_gap, 4), effect.grade) == (told["share_of_gap"], told["grade"])
        assert round(effect.probability, 3) == told["probability"]


@pytest.mark.slow
def test_a_diagnosis_draws_and_tells_itself(found: pb.Diagnosis):
    drawn = axes()
    assert found.plot(drawn) is drawn
    assert [x.get_label() for x in drawn.lines] == ["measured", "recalibrated", "corrected"]
    assert "\n" not in repr(found)
    assert "array" not in repr(found.effects)
    assert "source_resistance" in found._repr_html_()
    frame = found.to_frame()
    assert set(frame["effect"]) - {"recalibrated"} == {"source_resistance"}
    with pytest.raises(AttributeError):
        found.names = ()  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.slow
def test_the_model_of_a_diagnosis_is_a_model_of_the_door(found: pb.Diagnosis, lagging: Record, tmp_path: Path):
    assert isinstance(found, pb.Diagnosis)
    assert isinstance(found.model, pb.PlantModel)
    assert len(found.model.to_frame()) == len(found.model.model.values())
    assert pb.load_model(found.save(tmp_path) / "model.toml").model == found.model.model
    again = pickle.loads(pickle.dumps(found))
    assert isinstance(again, pb.Diagnosis)
    # a result stands for its model wherever a model is asked for
    over = pb.compare(lagging, found)
    assert over.to_dict() == pb.compare(lagging, found.model).to_dict()
    assert "PlantModel" not in repr(over)
    assert pb.build_fmu(found).content == pb.build_fmu(found.model).content
    # with what the records leave open, as the saved file has it
    tuned = pb.tune(found, method="simc")
    assert tuned.gains == pb.tune(tmp_path / "model.toml", method="simc").gains
    assert pickle.loads(pickle.dumps(tuned)).to_dict() == tuned.to_dict()


@pytest.mark.parametrize(
    "call", [pb.tune, pb.load_model, lambda x: pb.compare("x.csv", x), lambda x: pb.watch("x", x, training="x")]
)
def test_what_has_no_model_is_named_by_its_kind(call):
    with pytest.raises(pb.InputError, match="model: found a Catalogue, expected"):
        call(pb.effects())


def test_a_record_twice_is_refused_by_a_first_model_as_by_a_diagnosis(lagging: Record):
    frame = pd.DataFrame(columns(lagging))
    said = "record 2: found the readings of record 1 again, expected another record; they would count twice"
    for call in (pb.fit_model, pb.diagnose):
        with pytest.raises(pb.InputError, match=said):
            call([frame, frame])


def test_a_model_and_its_fmu(tmp_path: Path):
    model = pb.load_model("paper").with_block("creep", gains=(0.1,), time_constants_s=(2.0,))
    assert pb.load_model(model.save(tmp_path) / "model.toml").model == model.model
    built = pb.build_fmu(model)
    assert built.save(tmp_path) == tmp_path
    assert {x.name for x in tmp_path.iterdir()} == {"model.toml", "PiezoBender.fmu", "PidController.fmu"}
    assert built.to_dict()["parameters"] == model.model.values()
    for x in (model, built):
        assert_it_draws_and_tells_itself(x)


def test_a_comparison_is_that_of_the_command(lagging: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    write_record(tmp_path / "one.csv", lagging)
    assert main(["compare", "one.csv", "--out", "command"]) == 0
    found = pb.compare("one.csv")
    told = json.loads(Path("command/comparison.json").read_text(encoding="utf-8"))
    assert list(told.pop("provenance")["inputs"]) == ["one.csv"]
    assert found.to_dict() == told
    found.save("door")
    assert Path("door/overlay.png").read_bytes() == Path("command/overlay.png").read_bytes()
    assert len(found.to_frame()) == len(lagging)
    assert_it_draws_and_tells_itself(found)


def test_effects_are_those_of_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["effects", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    everything = pb.effects()
    assert json.loads(json.dumps(list(everything.to_dict().values()))) == told
    assert everything["creep"].only.id == "creep"
    assert_it_draws_and_tells_itself(everything)
    everything.save(tmp_path)
    assert [x.name for x in tmp_path.iterdir()] == ["effects.json"]
    assert set(everything.to_frame()["effect"]) == {x["id"] for x in told}


@pytest.mark.slow
def test_a_tuning_is_that_of_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    assert main(["tune", "--evaluations", "8", "--seed", "3", "--out", "command"]) == 0
    steps: list[str] = []
    found = pb.tune(evaluations=8, seed=3, progress=steps.append)
    found.save("door")
    assert Path("door/gains.toml").read_bytes() == Path("command/gains.toml").read_bytes()
    assert steps[0].startswith("learning the plant, 0 of 4")
    assert any(x.startswith("tuning with reliable_bas, 1 of 8") for x in steps)
    assert steps[-1].startswith("judging the gains, 3 of 4")
    assert found.metrics is not None
    assert found.to_dict()["status"] == "complete"
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(pb.InputError, match="python-control is not installed"):
        found.to_control()
    assert_it_draws_and_tells_itself(found)


@pytest.mark.slow
def test_an_identification_saves_draws_and_tells_itself(tmp_path: Path):
    time_s = np.arange(600) / 30
    volts = 25.0 - 25.0 * np.cos(2.0 * np.pi * 0.2 * time_s)
    plant = pb.load_model("paper")
    record = pb.load_record(time_s=time_s, voltage_V=volts, displacement_um=plant.simulate(time_s, volts))
    found = pb.identify(record, ensemble=0, library="paper", name="learned")
    saved = {x.name for x in found.save(tmp_path).iterdir()}
    assert saved == {"learned.toml", "learned-report.html", "learned-loops.png", "learned-figures.json"}
    assert pb.load_model(tmp_path / "learned.toml").model == found.plant.model
    assert_it_draws_and_tells_itself(found)
    assert "held_out_by" in found.to_dict()


def test_a_run_with_late_ticks_is_not_as_planned(lagging: Record, tmp_path: Path):
    from bender_hil.guard.guard import Status
    from bender_hil.guard.spares import Ended
    from bender_hil.log.read_run import RunLog
    from bender_hil.log.summary import Summary
    from bender_hil.runner.run import RunResult
    from piezo_bender.bench_runs import BenchRun

    summary = Summary(90, 0, 16, 0, 0, 0, (5.0, 9.0, 60.0), True, 30.0, 40.0)
    log = RunLog(tmp_path, {"emulated": True}, (), (), ())
    result = RunResult(tmp_path, Ended(Status.DONE, None, None, "", {}), False, None, summary, log)
    ended = BenchRun(result, load_arrays(lagging)).to_dict()["ended"]
    assert ended == "not as planned; 16 of 90 ticks late; output off"


@pytest.mark.slow
def test_a_run_on_the_emulated_bench_is_kept_and_drawn(tmp_path: Path):
    pytest.importorskip("cv2")
    steps: list[str] = []
    (tmp_path / "bench.toml").write_text(PATIENT)
    found = pb.run_bench(
        tmp_path / "bench.toml", setpoint_um=8.0, duration_s=1.5, out=tmp_path / "run", progress=steps.append
    )
    assert found.directory == tmp_path / "run"
    ended = found.to_dict()["ended"]
    assert ended.startswith(("as planned", "not as planned"))
    assert ended.endswith("output off")
    assert len(found.to_frame()) == len(found.record)
    assert (found.save(tmp_path / "copy") / "record.csv").is_file()
    with pytest.raises(pb.InputError, match="holds something already"):
        found.save(tmp_path / "copy")
    assert_it_draws_and_tells_itself(found)
    assert steps


def test_a_frame_is_read_by_the_heads_that_files_have(lagging: Record):
    frame = pd.DataFrame(
        {"t [ms]": 1e3 * lagging.time_s, "Spannung": lagging.voltage_V, "position (mm)": 1e-3 * lagging.displacement_um}
    )
    found = pb.load_record(frame)
    assert found.time_s == pytest.approx(lagging.time_s)
    assert found.displacement_um == pytest.approx(lagging.displacement_um)


def test_a_plant_is_simulated_as_its_model_is(lagging: Record):
    found = pb.simulate("beam", time_s=lagging.time_s, voltage_V=lagging.voltage_V)
    assert found.displacement_um == pytest.approx(
        pb.load_model("beam").simulate(lagging.time_s, lagging.voltage_V), abs=1e-3
    )
    assert found.to_frame().shape == (len(lagging), 3)


def test_a_loop_with_an_integral_comes_to_its_set_point():
    found = pb.simulate_loop(Gains(0.0, 10.0, 0.0), "paper", setpoint_um=8.0, duration_s=3.0)
    assert found.displacement_um[-1] == pytest.approx(8.0, rel=1e-2)
    assert [round(x.to_um) for x in found.steps] == [8]
    with pytest.raises(pb.InputError, match="lower_V"):
        pb.simulate_loop(Gains(0.0, 10.0, 0.0), "paper", lower_V=50.0, upper_V=0.0)


def test_a_step_settles_in_a_simulation_as_in_the_tuning_of_its_gains():
    tuned = pb.tune("paper", method="simc", setpoint_um=8.0)
    judgement = tuned.session.contenders[0].judgement
    assert judgement is not None
    (step,) = pb.simulate_loop(tuned, "paper", setpoint_um=8.0).steps
    wanted = judgement.metrics
    assert step.settling_time_s == pytest.approx(wanted.settling_time_s, abs=1e-6)
    assert step.overshoot_percent == pytest.approx(wanted.overshoot_percent, abs=1e-3)
    assert wanted.settling_time_s % (1.0 / 30.0) > 1e-3, "it arrives between two frames"


@needs_compiler
def test_gains_of_an_fmu_have_the_units_of_its_variables(tmp_path: Path):
    fmu = foreign_fmu(tmp_path / "oven.fmu", input_unit="W", output_unit="K", gain=0.5)
    tuned = pb.tune(fmu=fmu, setpoint_um=10.0, rate_Hz=20.0, upper_V=40.0, evaluations=4)
    assert "W/K" in repr(tuned)
    assert "µm" not in repr(tuned) + tuned._repr_html_()
    figures = tuned.to_frame().drop(columns=["method", "bounds", "derivative_on_error"])
    assert all(kind == float for kind in figures.dtypes)  # noqa: E721
    loop = pb.simulate_loop(tuned, fmu=fmu, setpoint_um=10.0)
    assert np.diff(loop.time_s) == pytest.approx(0.05)
    assert (loop.units, "K rms" in repr(loop)) == (("W", "K"), True)
    assert pb.simulate_loop(tuned, fmu=fmu, setpoint_um=10.0, upper_V=5.0).trace.voltage_V.max() <= 5.0
    with pytest.raises(pb.InputError, match=r"setpoint 90 K is out of reach: between 0 and 50 W"):
        pb.tune(fmu=fmu, setpoint_um=90.0)


@needs_compiler
def test_units_that_an_fmu_does_not_declare_are_given(tmp_path: Path):
    fmu = foreign_fmu(tmp_path / "oven.fmu", input_unit="", output_unit="", gain=0.5)
    tuned = pb.tune(fmu=fmu, units="W,K", setpoint_um=10.0, evaluations=4)
    assert "W/K" in repr(tuned)
    assert pb.simulate_loop(tuned, fmu=fmu, units="W,K").units == ("W", "K")
    with pytest.raises(pb.InputError, match="units: found 'W', expected the units of input and output"):
        pb.tune(fmu=fmu, units="W")


def test_a_slow_loop_runs_as_long_as_it_is_asked_to():
    found = pb.simulate_loop(Gains(0.0, 0.05, 0.0), "beam", rate_Hz=0.2, setpoint_um=8.0, duration_s=60.0)
    assert found.time_s[-1] == pytest.approx(60.0, abs=5.0)


def test_a_first_model_has_the_lag_that_was_recorded(tmp_path: Path):
    found = pb.fit_model(record_of("beam", LAG, levels(12.0)), template="gain+lag", name="mine")
    numbers = {x["name"]: x["value"] for x in found.to_dict()["numbers"]}
    frame = found.to_frame()
    assert list(frame["name"]) == [*numbers, "offset of record"]
    assert [str(frame[x].dtype) for x in ("value", "std", "low_95", "high_95")] == ["float64"] * 4
    assert pickle.loads(pickle.dumps(found)).to_dict() == found.to_dict()
    assert numbers.pop("gain") > 0.0
    assert found.model.model == found.plant.model
    assert any(abs(x - 0.08) < 0.01 for x in numbers.values())
    assert {x.name for x in found.save(tmp_path).iterdir()} == {"model.toml", "model.fmu", "model.json"}


@pytest.mark.slow
@needs_compiler
def test_parameters_of_an_fmu_are_calibrated(tmp_path: Path):
    fmu = foreign_fmu(tmp_path / "lag.fmu", gain=1e-6)
    rng = np.random.default_rng(5)
    time_s, voltage_V = np.arange(400) / 50.0, np.repeat(rng.uniform(0.0, 20.0, 40), 10)
    truth = pb.simulate(fmu=fmu, time_s=time_s, voltage_V=voltage_V, parameters={"gain": 1.3e-6})
    record = Record(time_s, voltage_V, truth.displacement_um + 0.01 * rng.standard_normal(time_s.size))
    found = pb.calibrate(record, fmu, ["gain=5e-7:2e-6"])
    assert found.values["gain"] == pytest.approx(1.3e-6, rel=1e-3)
    assert found.to_frame()["is_off"].tolist() == [True]


def test_settings_are_seen_and_results_pickle():
    assert {"setpoint_um", "evaluations"} <= set(inspect.signature(pb.tune).parameters)
    model, record = pb.load_model("beam"), pb.load_record(record_of())
    assert pickle.loads(pickle.dumps(model)).to_dict() == model.to_dict()
    assert len(pickle.loads(pickle.dumps(record))) == len(record)


def test_a_tuning_pickles_without_its_plant(tmp_path: Path):
    tuned = pb.tune("beam", setpoint_um=5.0, evaluations=5, monte_carlo=0)
    again = pickle.loads(pickle.dumps(tuned))
    assert again.gains == tuned.gains
    assert {"proportional_V_per_um", "integral_V_per_um_s"} <= set(again.to_frame())
    assert {"gains.toml", "loop.png"} <= {x.name for x in again.save(tmp_path).iterdir()}
    with pytest.raises(pb.RunError, match="the FMU of this tuning is closed"):
        again.session.problem.experiment.run(again.gains)


@pytest.mark.parametrize(
    ("model", "words"),
    [("paper", "the model paper"), ("a/mine.toml", "the model mine"), ("a/b/model.toml", "b/model.toml")],
)
def test_a_model_file_of_the_usual_name_is_told_by_its_folder(model: str, words: str) -> None:
    assert model_words(model) == words
