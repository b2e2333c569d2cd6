import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from bench_trials.kills import ATTEMPTS, SCENARIOS, Chain, Scenario, run_chain
from bench_trials.played_rows import played_rows

from bender_hil.bench_file import emulated_bench
from bender_hil.log.read_run import GUARD, RUN
from bender_investigate.real_bench import RealBench
from bender_loop.errors import InputError
from bender_native.ready import ready_plant_fmu

RATE_HZ = 30.0


def _lines(path: Path, *entries: dict) -> None:
    path.write_text("".join(json.dumps({"n": n, **entry}) + "\n" for n, entry in enumerate(entries)))


def _play(folder: Path, levels: list[float], ticks: int, begin_s: float) -> None:
    """A run that has sent the first rows of a profile."""
    folder.mkdir(parents=True)
    rows = "".join(f"{k / RATE_HZ!r},{v!r}\n" for k, v in enumerate([*levels, levels[-1]]))
    (folder / "profile.csv").write_text("time_s,voltage_V\n" + rows)
    sent = [
        {"t": begin_s + k / RATE_HZ, "kind": "tick", "sequence": k, "time_s": k / RATE_HZ,
         "sent_s": begin_s + k / RATE_HZ, "command_V": levels[k]}
        for k in range(ticks)
    ]  # fmt: skip
    _lines(folder / RUN, {"t": begin_s - 1.0, "kind": "start"}, *sent)


def test_the_rest_of_a_profile_repeats_nothing(tmp_path):
    levels = [0.1 * k for k in range(60)]
    _play(tmp_path / "01-rest", levels, 25, 100.0)
    _play(tmp_path / "02-rest-rest", [0.0, 1.0, 2.0, *levels[25:]], 38, 200.0)
    taken = [(100.0 + k / RATE_HZ, levels[k]) for k in range(25)]
    found = played_rows(tmp_path, RATE_HZ, taken)
    assert (found.rows, found.twice, found.levels, found.unknown) == (60, (), 24, 0)


def test_rows_and_set_points_that_are_played_twice_are_found(tmp_path):
    levels = [0.1 * k for k in range(60)]
    _play(tmp_path / "01-rest", levels, 25, 100.0)
    _play(tmp_path / "02-rest-rest", [0.0, 1.0, 2.0, *levels[23:]], 38, 200.0)
    for name in ("03-old-1", "04-old-1"):
        _play(tmp_path / name, levels, 3, 300.0)
        (tmp_path / name / "profile.csv").unlink()
    found = played_rows(tmp_path, RATE_HZ, [])
    assert found.twice[0].startswith("04-old-1 repeats 03-old-1")
    assert found.twice[1].startswith("02-rest-rest plays 2 rows again, the first at 0.77 s")


def test_a_level_that_no_journal_knows_is_found(tmp_path):
    _play(tmp_path / "01-rest", [1.0, 2.0, 3.0], 3, 100.0)
    assert played_rows(tmp_path, RATE_HZ, [(100.0, 1.0), (100.1, 4.0), (90.0, 9.0)]).unknown == 1


@pytest.mark.parametrize(
    ("ticks", "taken", "reached_s"),
    [(40, 40, 39.0 / 30.0), (40, 38, 39.0 / 30.0), (40, 41, 40.0 / 30.0), (0, 1, 0.0), (1, 0, 0.0)],
)
def test_what_either_process_knows_of_counts_as_played(tmp_path, ticks, taken, reached_s):
    """One killed between an act and its journal leaves it in the journal of the other."""
    _play(tmp_path / "run", [0.0] * 60, ticks, 100.0)
    _lines(
        tmp_path / "run" / GUARD,
        *({"t": 100.0, "kind": "applied", "sequence": k, "voltage_V": 0.0, "command_time_s": 100.0}
          for k in range(taken))
    )  # fmt: skip
    (tmp_path / "run" / "record.csv").write_text("time_s,voltage_V,displacement_um\n0,0,0\n0.1,0,0\n")
    bench = RealBench(emulated_bench(), ready_plant_fmu)
    kept = bench.recovered(tmp_path / "run")
    assert kept is not None
    assert kept.seconds == pytest.approx(reached_s)


def test_a_run_that_sent_nothing_is_played_and_one_with_a_damaged_journal_is_not(tmp_path):
    bench = RealBench(emulated_bench(), ready_plant_fmu)
    assert bench.recovered(tmp_path) is None
    (tmp_path / RUN).write_text('{"n": 0, "kin')
    assert bench.recovered(tmp_path) is None
    _lines(tmp_path / RUN, {"t": 0.0, "kind": "start"})
    assert bench.recovered(tmp_path) is None
    (tmp_path / RUN).write_text('{"n": 0, "kind": "start"}\nnonsense\n')
    with pytest.raises(InputError, match=r"run.jsonl, line 2: found 'nonsense', expected an entry"):
        bench.recovered(tmp_path)


@pytest.mark.slow
@pytest.mark.timeout(500)
@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals and /proc")
def test_every_process_is_killed_at_rest_and_nothing_is_played_twice(tmp_path):
    scenario = replace(SCENARIOS[0], budget_s=20.0, phases=("rest",))
    chain = run_chain(scenario, ready_plant_fmu("bench"), tmp_path)
    expected = [(phase, who) for phase in scenario.phases for group in ATTEMPTS[phase] for who in group]
    assert [(x.phase, x.who) for x in chain.kills] == expected
    assert_whole(chain)
    by_who = {x.who: x for x in chain.kills}
    assert (by_who["guard"].outcome, by_who["guard"].status) == ("off", 1)
    assert (by_who["supply"].outcome, by_who["supply"].status) == ("alarm", 3)
    assert chain.played.rows >= 460


@pytest.mark.trial
@pytest.mark.timeout(3600)
@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals and /proc")
@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda x: x.name)
def test_every_process_is_killed_in_every_phase_and_nothing_is_played_twice(scenario: Scenario, tmp_path: Path):
    assert_whole(run_chain(scenario, ready_plant_fmu("bench"), tmp_path))


def assert_whole(chain: Chain) -> None:
    """Every kill and the end are as they should be, none was missed, nothing was played twice."""
    assert [x for x in chain.kills if x.broken] == []
    assert (chain.broken, chain.missed, chain.played.twice, chain.played.unknown) == ("", (), (), 0)
