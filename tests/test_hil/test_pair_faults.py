"""Faults over pairs of source and sensor: a slice among the slow tests, all of them by `pytest -m trial`."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from bench_trials.pair_faults import PAIRS, PairCell, faults_of, pair_bench, run_pair_cell

from bender_hil.emulated import MICROSCOPE

pytest.importorskip("pyvisa_py")

SLICE = [
    ("SDG", "34465A", ("source: no answers", "sensor: nonsense", "sensor: says the same for ever")),
    ("MDT693B", "text", ("source: cannot be brought to 0 V", "sensor: hangs", "sensor: jumps away")),
    ("GCS", "DMM6500", ("source: another one answers", "sensor: overload", "sensor: scatters")),
    ("9115", "RedPitaya", ("source: hangs", "sensor: nonsense", "sensor: link drops for good", "sensor: overload")),
    ("33500", "DSOX", ("source: garbled answers", "sensor: hangs", "sensor: scatters")),
    ("daq", "daq", ("source: no answers", "source: hangs", "sensor: jumps away")),
    ("33500", MICROSCOPE, ("source: link drops for good", "sensor: says the same for ever")),
]


def test_every_pair_has_faults_of_both():
    assert len(PAIRS) == 42
    for _, sensor in PAIRS:
        names = faults_of(sensor)
        assert sum(name.startswith("source") for name in names) >= 8
        assert sum(name.startswith("sensor") for name in names) >= (1 if sensor == "daq" else 5)


@pytest.mark.parametrize(
    ("source", "sensor", "faults"),
    [
        *(pytest.param(*row, marks=pytest.mark.slow) for row in SLICE),
        *(pytest.param(*pair, faults_of(pair[1]), marks=pytest.mark.trial) for pair in PAIRS),
    ],
)
def test_whatever_fails_the_output_is_off_or_an_alarm_is_given(
    source: str, sensor: str, faults: Sequence[str], tmp_path: Path
):
    from bender_export.build import ensure_plant_fmu

    found: list[PairCell] = []
    with pair_bench(source, sensor, ensure_plant_fmu("bench")) as bench:
        for number, fault in enumerate(faults):
            found.append(run_pair_cell(bench, source, sensor, fault, tmp_path / str(number)))
    assert [cell for cell in found if cell.broken] == []
    assert {cell.outcome for cell in found} <= {"off", "alarm"}
