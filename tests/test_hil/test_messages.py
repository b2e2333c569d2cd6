"""Messages between the processes of a run, and ticks that are late."""

import socket
import threading
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_hil.bench_file import BenchFile
from bender_hil.log.read_run import RunLog
from bender_hil.log.summary import summarise
from bender_hil.sensors.daq_input import DaqInputSettings
from bender_hil.sensors.multimeter import MultimeterSettings
from bender_hil.sensors.table import SensorTable
from bender_hil.sensors.text_line import TextLineSettings
from bender_loop.shell.messages import Channel, ClosedError, Listener, call
from bender_studies.bench_trials.kilohertz import complete_to_command_ms

MESSAGES = st.dictionaries(
    st.text(max_size=5), st.none() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
)


@pytest.fixture
def pair():
    listener = Listener()
    near = call(listener.port, listener.password)
    far = listener.accept(5.0)
    listener.close()
    with near, far:
        yield near, far


def test_messages_arrive_as_they_were_sent(pair: tuple[Channel, Channel]):
    near, far = pair

    @given(st.lists(MESSAGES, max_size=5))
    def holds(messages: list[dict[str, object]]) -> None:
        for message in messages:
            near.send(message)
        assert [far.receive(5.0) for _ in messages] == messages
        assert not far.has_message()

    holds()


def test_nothing_is_none_and_an_end_is_an_end(pair: tuple[Channel, Channel]):
    near, far = pair
    assert far.receive(0.0) is None
    near.send({"last": 1})
    near.close()
    assert far.has_message()
    assert far.receive(1.0) == {"last": 1}
    with pytest.raises(ClosedError):
        far.receive(1.0)
    with pytest.raises(ClosedError):
        _send_until_it_fails(far)


def _send_until_it_fails(channel: Channel) -> None:
    # the first may still find room in a buffer
    for _ in range(100):
        channel.send({"to": "nobody"})


@pytest.mark.parametrize("line", [b"nonsense\n", b"[1]\n", b"\xff\xfe\n"])
def test_another_language_ends_the_conversation(pair: tuple[Channel, Channel], line: bytes):
    near, far = pair
    near._stream.sendall(line)
    with pytest.raises(ClosedError):
        far.receive(1.0)


def test_a_number_that_json_does_not_know_is_never_sent(pair: tuple[Channel, Channel]):
    with pytest.raises(ValueError, match="JSON"):
        pair[0].send({"voltage_V": float("nan")})


def test_only_who_knows_the_password_is_let_in():
    listener = Listener()
    stranger = socket.create_connection(("127.0.0.1", listener.port))
    stranger.sendall(b'{"password": "guess"}\n')
    late = threading.Timer(0.2, lambda: friends.append(call(listener.port, listener.password)))
    friends: list[Channel] = []
    late.start()
    with listener.accept(5.0) as channel:
        late.join()
        friends[0].send({"hello": 1})
        assert channel.receive(5.0) == {"hello": 1}
    friends[0].close()
    stranger.close()
    with pytest.raises(ClosedError, match="nobody called"):
        listener.accept(0.05)
    listener.close()
    with pytest.raises(ClosedError):
        call(listener.port, listener.password)


def _log(period_s: float, averaged_s: float, delays_s: list[float]) -> RunLog:
    """A run whose commands are on the wire so long after their readings are complete."""
    ticks, guard = [], []
    for k, delay_s in enumerate(delays_s):
        grabbed_s = 100.0 + k * period_s
        sent_s = grabbed_s + 0.5 * averaged_s + delay_s
        ticks.append(
            {"kind": "tick", "sequence": k, "grabbed_s": grabbed_s, "sent_s": sent_s, "skipped": 0, "measured_um": 1.0,
             "late": False}
        )  # fmt: skip
        guard.append({"kind": "applied", "sequence": k, "command_time_s": sent_s, "whole": True, "t": sent_s})
    start = {
        "emulated": True, "period_s": period_s, "exposure_s": averaged_s, "deadline_s": period_s + 0.5 * averaged_s,
    }  # fmt: skip
    return RunLog(Path(), start, tuple(ticks), (), tuple(guard))


@given(
    period_s=st.floats(1e-3, 0.1),
    averaged=st.floats(0.0, 1.0),
    shares=st.lists(st.floats(0.0, 3.0).filter(lambda x: abs(x - 1.0) > 1e-3), min_size=2, max_size=20),
)
def test_what_is_averaged_makes_no_tick_late(period_s: float, averaged: float, shares: list[float]):
    log = _log(period_s, averaged * period_s, [share * period_s for share in shares])
    assert summarise(log).late == sum(share > 1.0 for share in shares)
    found_ms = complete_to_command_ms(log)
    assert found_ms == pytest.approx([1e3 * share * period_s for share in shares], abs=1e-6)


def test_a_run_of_an_earlier_version_counts_its_period():
    log = _log(0.01, 0.0, [0.005, 0.015])
    start = {name: value for name, value in log.start.items() if name != "deadline_s"}
    assert summarise(replace(log, start=start)).late == 1


@pytest.mark.parametrize(
    ("table", "averaged_s"),
    [
        (SensorTable("daq", DaqInputSettings("Dev1"), 1000.0), 1e-3),
        (SensorTable("daq", DaqInputSettings("Dev1"), 1000.0, exposure_s=2e-4), 2e-4),
        (SensorTable("multimeter", MultimeterSettings("ASRL1::INSTR", aperture_s=0.02), 30.0), 0.02),
        (SensorTable("text", TextLineSettings("ASRL1::INSTR"), 30.0), None),
    ],
)
def test_the_deadline_of_a_sensor_is_a_period_after_half_of_what_it_averages(
    table: SensorTable, averaged_s: float | None
):
    assert table.averaged_s == averaged_s
    assert BenchFile(sensor=table).deadline_s == pytest.approx(1.0 / table.rate_Hz + 0.5 * (averaged_s or 0.0))
