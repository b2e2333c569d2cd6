"""Real workers in processes of their own: deaths of a worker and of the client, a scheduler that runs, TLS."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

import pytest

pytest.importorskip("distributed")
pq = pytest.importorskip("pyarrow.parquet")

from fleet_stand_in import SLEEP_S, Sleeping, cluster_of_processes, task, units  # noqa: E402

from bender_fleet.cluster.settings import ClusterSettings  # noqa: E402
from bender_fleet.run import Count, How, run_fleet  # noqa: E402
from bender_loop.errors import InputError  # noqa: E402

pytestmark = [
    pytest.mark.timeout(240),
    # Dask leaves loops and sockets to the garbage collector when a cluster ends
    pytest.mark.filterwarnings("default"),
]
UNITS = 24
CLIENT = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parents[1])!r})
from pathlib import Path
from bender_fleet.cluster.settings import ClusterSettings
from bender_fleet.run import How, run_fleet
from fleet_stand_in import Sleeping, task, units
if __name__ == "__main__":
    out, log = sys.argv[1:]
    work = task(Sleeping(0.3, log=log))
    count = run_fleet("diagnose", units(24), lambda _: work, How(ClusterSettings(workers=1), Path(out)), {{}}, print)
    sys.exit(130 if count.interrupted else 0)
"""


def _run(out: Path, work: Sleeping, cluster: ClusterSettings | None = None, **how: bool) -> Count:
    done = task(work)
    where = How(cluster or ClusterSettings(workers=1), out, **how)
    return run_fleet("diagnose", units(UNITS), lambda _: done, where, {}, lambda _: None)


def _tables(out: Path) -> list[list[dict[str, object]]]:
    return [pq.read_table(out / name).to_pylist() for name in ("units.parquet", "effects.parquet")]


def _begun(log: Path) -> Counter[str]:
    return Counter(x.name.partition(".")[0] for x in log.iterdir())


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> list[list[dict[str, object]]]:
    out = tmp_path_factory.mktemp("fleet") / "out"
    assert _run(out, Sleeping(0.0)).new == UNITS
    return _tables(out)


def test_nothing_of_the_cluster_is_left_in_the_temporary_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scratch = tmp_path / "temporary"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    monkeypatch.setenv("TMPDIR", str(scratch))
    assert _run(tmp_path / "out", Sleeping(0.0)).new == UNITS
    assert [x.name for x in scratch.iterdir() if "dask" in x.name or x.name.startswith("bender-fleet-")] == []


def _worker_at(log: Path, count: int, client: "subprocess.Popen[bytes] | None" = None) -> int:
    """Return the process id of the worker that begins the unit of that number."""
    while len(begun := [x for x in log.iterdir() if not x.name.startswith(".")]) < count:
        assert client is None or client.poll() is None
        time.sleep(0.02)
    return int(max(begun, key=lambda x: x.stat().st_mtime_ns).read_text(encoding="utf-8"))


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system has no kill -9")
def test_a_killed_worker_costs_the_unit_in_its_hand_and_nothing_else(
    tmp_path: Path, undisturbed: list[list[dict[str, object]]]
) -> None:
    log, out = tmp_path / "log", tmp_path / "out"
    log.mkdir()

    def kill() -> None:
        os.kill(_worker_at(log, 4), signal.SIGKILL)

    thread = threading.Thread(target=kill)
    thread.start()
    count = _run(out, Sleeping(0.15, log=str(log)))
    thread.join()
    assert (count.new, count.missing) == (UNITS, 0)
    again = {name: times for name, times in _begun(log).items() if times > 1}
    assert len(again) <= 1
    assert all(times == 2 for times in again.values())
    assert _tables(out) == undisturbed


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system has no kill -9")
def test_a_unit_that_ends_its_worker_three_times_is_a_row_with_that_reason(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.mkdir()
    count = _run(tmp_path / "out", Sleeping(0.0, fatal=("none-3",), log=str(log)))
    assert count.statuses["failed"] == 1
    rows = {x["unit"]: x for x in pq.read_table(tmp_path / "out/units.parquet").to_pylist()}
    assert "ended its worker 3 times" in rows["unit-00003"]["reason"]
    begun = _begun(log)
    assert begun["none-3"] == 3
    assert all(times == 1 for name, times in begun.items() if name != "none-3")
    assert _run(tmp_path / "out", Sleeping(0.0)).new == 0
    assert _run(tmp_path / "out", Sleeping(0.0), retry=True).statuses["done"] == count.statuses["done"] + 1


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system has no kill -9")
def test_a_killed_client_loses_nothing_and_nothing_is_done_twice(
    tmp_path: Path, undisturbed: list[list[dict[str, object]]]
) -> None:
    log, out = tmp_path / "log", tmp_path / "out"
    client = _client(tmp_path, out, log)
    worker = _worker_at(log, 6, client)
    client.kill()
    client.communicate()
    _until_gone(worker)
    done = len(list((out / "units").glob("*/*.parquet")))
    assert 0 < done < UNITS
    count = _run(out, Sleeping(0.0, log=str(log)))
    assert (count.kept, count.new) == (done, UNITS - done)
    again = {name: times for name, times in _begun(log).items() if times > 1}
    assert len(again) <= 1
    assert _tables(out) == undisturbed


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="this system has no groups of processes")
def test_ctrl_c_on_a_terminal_keeps_what_is_complete_and_prints_no_traceback(
    tmp_path: Path, undisturbed: list[list[dict[str, object]]]
) -> None:
    log, out = tmp_path / "log", tmp_path / "out"
    client = _client(tmp_path, out, log)
    _worker_at(log, 6, client)
    os.killpg(client.pid, signal.SIGINT)
    _, said = client.communicate(timeout=60)
    assert client.returncode == 130
    assert b"Traceback" not in said
    done = len(pq.read_table(out / "units.parquet"))
    assert 0 < done < UNITS
    assert _run(out, Sleeping(0.0)).kept >= done
    assert _tables(out) == undisturbed


def _client(folder: Path, out: Path, log: Path) -> "subprocess.Popen[bytes]":
    """Start a client in a group of its own, as a terminal does."""
    log.mkdir()
    script = folder / "client.py"
    script.write_text(CLIENT, encoding="utf-8")
    words = [sys.executable, str(script), str(out), str(log)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)


def _until_gone(process: int) -> None:
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    pytest.fail("the worker of a killed client lives on")


@pytest.mark.slow
@pytest.mark.parametrize("shared_disk", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_a_scheduler_that_runs_is_found_by_its_file(
    shared_disk: bool, tmp_path: Path, undisturbed: list[list[dict[str, object]]]
) -> None:
    with cluster_of_processes(1, tmp_path / "cluster") as cluster:
        assert _run(tmp_path / "out", Sleeping(0.0), cluster, shared_disk=shared_disk).new == UNITS
    assert _tables(tmp_path / "out") == undisturbed


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl to make a certificate")
def test_a_scheduler_behind_tls_takes_those_with_its_certificate_only(tmp_path: Path) -> None:
    words = "req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=fleet -keyout key.pem -out cert.pem"
    subprocess.run(["openssl", *words.split()], cwd=tmp_path, check=True, capture_output=True)
    cert, key = tmp_path / "cert.pem", tmp_path / "key.pem"
    options = ["--protocol", "tls", "--tls-ca-file", str(cert), "--tls-cert", str(cert), "--tls-key", str(key)]
    with cluster_of_processes(1, tmp_path / "cluster", options) as plain:
        address = json.loads((tmp_path / "cluster/scheduler.json").read_text(encoding="utf-8"))["address"]
        assert address.startswith("tls://")
        ours = ClusterSettings(scheduler=address, tls_ca=cert, tls_cert=cert, tls_key=key)
        assert _run(tmp_path / "out", Sleeping(0.0), ours).new == UNITS
        with pytest.raises(InputError, match="no scheduler answers"):
            _run(tmp_path / "other", Sleeping(0.0), plain)
    assert not (tmp_path / "other").exists()


@pytest.mark.trial
@pytest.mark.timeout(600)
@pytest.mark.parametrize("place", ["local", "processes"])
def test_scheduling_of_thousands_costs_little_beside_their_sleep(place: str, tmp_path: Path) -> None:
    from bender_fleet.page.page import write_page

    workers, asleep = 2, task(Sleeping())
    local = contextlib.nullcontext(ClusterSettings(workers=workers))
    with local if place == "local" else cluster_of_processes(workers, tmp_path / "processes") as cluster:
        count = run_fleet(
            "diagnose", units(10_000), lambda _: asleep, How(cluster, tmp_path / "out"), {}, lambda _: None
        )
    began = time.perf_counter()
    page = write_page(tmp_path / "out", "diagnose")
    assert time.perf_counter() - began < 5.0
    assert page.stat().st_size < 15e6
    assert count.seconds / count.new - SLEEP_S / workers < 5e-3
