"""The notebook's door: load, build, compare, tune, identify, diagnose and run a bench from Python.

    import piezo_bender as pb

    found = pb.diagnose("record.csv", model="paper")
    found.plot()
    found.save("results/diagnosis")

Every function takes paths or objects and returns a frozen result with `save(folder)`, `plot(axes)`, `to_dict()` and,
where it is a table, `to_frame()`. Bad input raises `InputError`, a `ValueError`, with the sentence of the command line
in which arguments stand for options, and nothing is written. Nothing is imported before it is asked for.

| module | holds |
|---|---|
| `records` | `load_record`: a file, a DataFrame or arrays |
| `models` | `load_model`, `build_fmu` |
| `first_models` | `fit_model`: a first model from records alone |
| `calibrations` | `calibrate`: parameters of an FMU, fitted to records |
| `simulations` | `simulate`: a plant under a command |
| `comparisons` | `compare`: a model or any FMU over a record |
| `tunings` | `tune`: gains for the PID block |
| `loops` | `simulate_loop`: a closed loop with any gains and any reference |
| `identifications` | `identify`: a hysteresis model learned from records |
| `diagnoses` | `diagnose`: which effect a model lacks |
| `several_outputs` | `diagnose_outputs`: the same of several outputs of one FMU, each by itself and together |
| `catalogue` | `effects`: all that a model may lack |
| `watches` | `watch`: whether a device is still its model, and what has changed |
| `bench_runs` | `run_bench`: the PID block or a profile on a bench |
| `bluesky` | the bench as a device and as plans of bluesky (extra `bluesky`) |
| `shared` | what the results share: axes, tables, HTML |
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bender_loop.errors import InputError, RunError
    from piezo_bender.bench_runs import BenchRun, run_bench
    from piezo_bender.calibrations import CalibratedFmu, calibrate
    from piezo_bender.catalogue import Catalogue, effects
    from piezo_bender.comparisons import RecordComparison, compare
    from piezo_bender.diagnoses import Diagnosis, diagnose
    from piezo_bender.first_models import FittedModel, fit_model
    from piezo_bender.identifications import IdentifiedModel, identify
    from piezo_bender.loops import LoopSimulation, simulate_loop
    from piezo_bender.models import PlantFmu, PlantModel, build_fmu, load_model
    from piezo_bender.records import LoadedRecord, load_record
    from piezo_bender.several_outputs import OutputsDiagnosis, diagnose_outputs
    from piezo_bender.simulations import Simulation, simulate
    from piezo_bender.tunings import TuningResult, tune
    from piezo_bender.watches import LiveWatch, Watched, start_watch, watch

_HOMES = {
    "BenchRun": "piezo_bender.bench_runs",
    "CalibratedFmu": "piezo_bender.calibrations",
    "Catalogue": "piezo_bender.catalogue",
    "Diagnosis": "piezo_bender.diagnoses",
    "FittedModel": "piezo_bender.first_models",
    "IdentifiedModel": "piezo_bender.identifications",
    "InputError": "bender_loop.errors",
    "LoadedRecord": "piezo_bender.records",
    "LoopSimulation": "piezo_bender.loops",
    "OutputsDiagnosis": "piezo_bender.several_outputs",
    "PlantFmu": "piezo_bender.models",
    "PlantModel": "piezo_bender.models",
    "RecordComparison": "piezo_bender.comparisons",
    "RunError": "bender_loop.errors",
    "Simulation": "piezo_bender.simulations",
    "TuningResult": "piezo_bender.tunings",
    "build_fmu": "piezo_bender.models",
    "calibrate": "piezo_bender.calibrations",
    "compare": "piezo_bender.comparisons",
    "diagnose": "piezo_bender.diagnoses",
    "diagnose_outputs": "piezo_bender.several_outputs",
    "effects": "piezo_bender.catalogue",
    "fit_model": "piezo_bender.first_models",
    "identify": "piezo_bender.identifications",
    "load_model": "piezo_bender.models",
    "load_record": "piezo_bender.records",
    "run_bench": "piezo_bender.bench_runs",
    "simulate": "piezo_bender.simulations",
    "simulate_loop": "piezo_bender.loops",
    "tune": "piezo_bender.tunings",
    "LiveWatch": "piezo_bender.watches",
    "Watched": "piezo_bender.watches",
    "start_watch": "piezo_bender.watches",
    "watch": "piezo_bender.watches",
}

__all__ = [
    "BenchRun",
    "CalibratedFmu",
    "Catalogue",
    "Diagnosis",
    "FittedModel",
    "IdentifiedModel",
    "InputError",
    "LiveWatch",
    "LoadedRecord",
    "LoopSimulation",
    "OutputsDiagnosis",
    "PlantFmu",
    "PlantModel",
    "RecordComparison",
    "RunError",
    "Simulation",
    "TuningResult",
    "Watched",
    "build_fmu",
    "calibrate",
    "compare",
    "diagnose",
    "diagnose_outputs",
    "effects",
    "fit_model",
    "identify",
    "load_model",
    "load_record",
    "run_bench",
    "simulate",
    "simulate_loop",
    "start_watch",
    "tune",
    "watch",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
