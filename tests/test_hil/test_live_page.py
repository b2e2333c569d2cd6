import asyncio
import json
import math
import threading
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from few import few_rows
from hypothesis import given
from hypothesis import strategies as st

from bender_cli.main import main
from bender_hil.guard.stop_ear import StopEar
from bender_hil.live.frame_board import FrameWriter, frame_number, read_frame
from bender_hil.live.output_view import OutputView
from bender_hil.live.page import Shown, charts, facts
from bender_hil.live.run_view import RunView, decisions, newest_run, whole_run
from bender_hil.live.stop_button import Button, server
from bender_hil.live.token_gate import TokenGate
from bender_hil.live.watch_view import WATCH
from bender_hil.log.read_run import GUARD, RUN

TOKEN = "0123456789abcdef0123456789abcdef"


def _tick(k: int, tip_um: float | None = 1.0, late: bool = False) -> dict:
    time_s = 100.0 + k / 30.0
    return {
        "n": k + 1, "t": time_s, "kind": "tick", "sequence": k, "frame": 10 + k, "grabbed_s": time_s,
        "measured_um": tip_um, "setpoint_um": 2.0, "command_V": 3.0, "sent_s": time_s + 0.004, "late": late,
    }  # fmt: skip


def _write(path: Path, *entries: dict) -> None:
    with path.open("a") as file:
        file.writelines(json.dumps(entry) + "\n" for entry in entries)


def test_a_view_follows_journals_that_grow(tmp_path):
    view = RunView(tmp_path)
    assert (view.update().ticks, view.output.state(math.inf, None)) == (0, "not armed")
    _write(tmp_path / RUN, {"n": 0, "t": 99.0, "kind": "start", "emulated": True})
    _write(
        tmp_path / GUARD,
        {"n": 0, "t": 99.0, "kind": "armed"},
        {"n": 1, "t": 100.5, "kind": "measured", "supply_voltage_V": 2.5},
    )
    view.update()
    assert (view.emulated, view.output.state(math.inf, None), view.measured(0.0, 9.0)) == (True, "armed", [])
    _write(tmp_path / RUN, _tick(0), _tick(1, None), _tick(2, late=True))
    view.update()
    assert (view.ticks, view.late, view.lost) == (3, 1, 1)
    assert view.measured(0.0, 9.0) == [(0.5, 2.5)]
    assert view.rows[0].latency_ms == pytest.approx(4.0)
    assert [row.is_late for row in view.rows] == [False, False, True]
    with (tmp_path / RUN).open("a") as file:
        file.write(json.dumps(_tick(3))[:40])
    assert view.update().ticks == 3
    with (tmp_path / RUN).open("a") as file:
        file.write(json.dumps(_tick(3))[40:] + "\n")
    # once the guard has ended, the journal knows which commands were late on the wire too
    _write(tmp_path / RUN, {"n": 5, "t": 101.0, "kind": "stop", "late_ticks": [1, 2]})
    assert (view.update().late, [row.is_late for row in view.rows]) == (2, [False, True, True, False])
    _write(
        tmp_path / GUARD,
        {"n": 2, "t": 101.0, "kind": "trip", "code": "stop", "sentence": "STOP was pressed"},
        {"n": 3, "t": 101.1, "kind": "output_off"},
        {"n": 4, "t": 101.2, "kind": "end", "alarm": ""},
    )
    view.update()
    assert (view.output.state(math.inf, None), view.output.is_over) == ("output off (stop: STOP was pressed)", True)


BEGIN = {"n": 0, "t": 99.0, "kind": "start", "emulated": True}


def _fallen(folder: Path, *more: dict) -> Shown:
    """A run of a second whose guard comes down from 40 V."""
    _write(folder / RUN, BEGIN, *(_tick(k) for k in range(31)))
    _write(
        folder / GUARD,
        {"t": 99.5, "kind": "armed"},
        {"t": 100.9, "kind": "measured", "supply_voltage_V": 38.5},
        {"t": 101.0, "kind": "trip", "code": "stop", "sentence": "STOP was pressed"},
        {"t": 101.0, "kind": "ramp", "from_V": 40.0, "rate_V_per_s": 400.0},
        *more,
    )
    shown = Shown(folder, None, "", clock=lambda: 101.05)
    shown.look(0.0)
    return shown


STEPS = {"t": 101.2, "kind": "came_down", "steps": [[101.0, 38.0], [101.06, 20.0], [101.15, 0.0]]}
OFF = {"t": 101.2, "kind": "output_off"}


def test_on_the_way_down_the_voltage_is_falling_and_the_ramp_is_drawn_as_far_as_it_has_come(tmp_path):
    shown = _fallen(tmp_path)
    told = dict(facts(shown))
    assert told["guard"] == "coming down, voltage falling (stop: STOP was pressed)"
    assert (told["command"], told["measured"]) == ("falling, 20.00 V", "falling; 38.50 V before")
    assert (told["set-point"], told["tip"]) == ("none", "1.00 µm, before the way down")
    command, measured, _ = charts(shown)["voltage"]
    assert command[-1] == (pytest.approx(1.05), pytest.approx(20.0, abs=0.01))
    assert max(t for t, _ in measured) == pytest.approx(0.9)
    assert shown.end == ""


def test_once_the_output_is_off_the_steps_are_drawn_as_they_were_sent(tmp_path):
    shown = _fallen(tmp_path, OFF, STEPS)
    told = dict(facts(shown))
    assert told["guard"] == "output off, voltage falling (stop: STOP was pressed)"
    assert (told["command"], told["measured"]) == ("off", "falling, not measured")
    command = charts(shown)["voltage"][0]
    assert command[-4:] == [(pytest.approx(t), v) for t, v in ((1.0, 38.0), (1.06, 20.0), (1.15, 0.0), (1.2, 0.0))]
    _write(tmp_path / GUARD, {"t": 101.25, "kind": "discharging", "measured_V": 12.0})
    shown.look(0.0)
    assert dict(facts(shown))["measured"] == "falling, 12.00 V"
    _write(tmp_path / GUARD, {"t": 101.4, "kind": "overdue", "sentence": "12 V are still measured"})
    shown.look(0.0)
    assert "do not touch" in dict(facts(shown))["guard"]
    _write(tmp_path / GUARD, {"t": 101.5, "kind": "harmless", "measured_V": -0.001}, {"t": 101.5, "kind": "end"})
    shown.look(0.0)
    assert dict(facts(shown))["measured"] == "off, 0.00 V"
    assert [v for _, v in charts(shown)["voltage"][2]] == [12.0, -0.001]
    assert shown.view is not None
    assert (shown.end, shown.is_settled, shown.view.duration_s) == ("output off, harmless", True, pytest.approx(1.5))


@pytest.mark.parametrize(
    ("entries", "command", "measured"),
    [
        (({"t": 101.03, "kind": "ramp_broken", "sentence": "lost"},), "falling, 28.00 V", "falling; 38.50 V before"),
        (({"t": 101.03, "kind": "not_confirmed", "attempt": 0},), "falling, 20.00 V", "falling; 38.50 V before"),
        # a source that cannot measure
        ((OFF, STEPS, {"t": 101.2, "kind": "end", "alarm": ""}), "off", "off, not measured"),
        (
            ({"t": 103.0, "kind": "end", "alarm": "OUTPUT STATE UNKNOWN (lost)"},),
            "not known",
            "not known; 38.50 V last",
        ),
    ],
)
def test_a_way_down_that_is_not_as_planned_is_shown_as_it_is(tmp_path, entries, command, measured):
    told = dict(facts(_fallen(tmp_path, *entries)))
    assert (told["command"], told["measured"]) == (command, measured)


def test_a_spare_guard_and_an_alarm_of_the_controller_are_shown(tmp_path):
    shown = _fallen(tmp_path)
    spare = {"t": 102.0, "kind": "ramp", "from_V": 0.0, "rate_V_per_s": 400.0}
    _write(tmp_path / "rescue.jsonl", spare, {"t": 102.1, "kind": "not_confirmed", "attempt": 0})
    shown.look(0.0)
    assert "not confirmed off yet" in dict(facts(shown))["guard"]
    assert not shown.is_settled
    _write(tmp_path / RUN, {"t": 103.0, "kind": "stop", "alarm": "OUTPUT STATE UNKNOWN: switch it off by hand"})
    shown.look(0.0)
    told = dict(facts(shown))
    assert told["guard"] == "OUTPUT STATE UNKNOWN: switch it off by hand"
    assert (told["command"], shown.end) == ("not known", "OUTPUT STATE UNKNOWN: switch it off by hand")


def test_a_guard_that_is_silent_is_said_and_a_replay_shows_what_was_said_then(tmp_path):
    _write(tmp_path / RUN, BEGIN, *(_tick(k) for k in range(31)))
    _write(tmp_path / GUARD, {"t": 99.5, "kind": "armed"}, {"t": 100.9, "kind": "measured", "supply_voltage_V": 38.5})
    shown = Shown(tmp_path, None, "", clock=lambda: 105.0)
    shown.look(0.0)
    assert dict(facts(shown))["guard"] == "armed, silent for 4 s"
    _fallen(tmp_path, OFF, STEPS)
    replay = Shown(tmp_path, None, "", is_replay=True, cursor_s=0.95, is_playing=False)
    replay.look(0.0)
    told = dict(facts(replay))
    assert (told["guard"], told["command"], told["measured"]) == ("armed", "3.00 V", "38.50 V")
    assert charts(replay)["voltage"][0][-1][1] == 3.0
    replay.cursor_s = 1.1
    assert dict(facts(replay))["command"] == "falling, 20.00 V"


KINDS = [
    "measured",
    "ramp_broken",
    "not_confirmed",
    "output_off",
    "discharging",
    "overdue",
    "harmless",
    "came_down",
    "end",
]


@given(st.lists(st.sampled_from(KINDS), max_size=8), st.floats(0.0, 10.0))
def test_no_voltage_from_before_the_way_down_is_shown_as_that_of_now(kinds, later_s):
    output = OutputView()
    output.take({"t": 0.0, "kind": "armed"})
    output.take({"t": 1.0, "kind": "measured", "supply_voltage_V": 38.5})
    output.take({"t": 2.0, "kind": "ramp", "from_V": 38.5, "rate_V_per_s": 100.0})
    for place, kind in enumerate(kinds):
        output.take({"t": 3.0 + place, "kind": kind, "measured_V": 1.0, "alarm": "lost", "steps": [[2.5, 3.0], [None]]})
    told = output.voltage(2.0 + later_s)
    assert told.startswith(("falling", "off", "not known"))
    assert "38.5" not in told or "before" in told or "last" in told
    assert output.command(2.0 + later_s) is not None
    line = output.descent(2.0 + later_s)
    assert all(2.0 <= t <= 2.0 + later_s for t, _ in line)
    assert [t for t, _ in line] == sorted(t for t, _ in line)


def test_few_points_keep_the_newest(tmp_path):
    shown = _fallen(tmp_path)
    _write(
        tmp_path / GUARD, OFF, *({"t": 101.3 + k / 1e3, "kind": "discharging", "measured_V": 9.0} for k in range(701))
    )
    _write(tmp_path / GUARD, {"t": 102.5, "kind": "harmless", "measured_V": 0.2})
    shown.look(0.0)
    assert charts(shown)["voltage"][2][-1] == (pytest.approx(2.5), 0.2)


def test_a_replay_shows_a_run_until_its_cursor(tmp_path):
    _write(tmp_path / RUN, {"n": 0, "t": 99.0, "kind": "start", "emulated": False}, *(_tick(k) for k in range(4000)))
    view = whole_run(tmp_path)
    assert view.ticks == len(view.rows) == 4000
    assert len(view.up_to(10.0)) == 301
    assert view.duration_s == pytest.approx(3999 / 30.0)


def test_a_watch_beside_the_run_is_drawn_in_lanes_of_its_own(tmp_path):
    _write(tmp_path / RUN, *(_tick(k) for k in range(1200)))
    shown = Shown(tmp_path, None, "")
    shown.look(0.0)
    assert charts(shown)["residual"] == [[]]
    assert "watch" not in dict(facts(shown))
    rows = [[k / 10, -1.0, 2.0, 0.01 * k] for k in range(300)]
    damaged = [None, [1.0], [30.0, "x", 0.0, 0.0]]
    _write(tmp_path / WATCH, {"kind": "begin"}, {"kind": "lane", "rows": rows}, {"kind": "lane", "rows": damaged})
    # one that was killed goes on from its last state, and says once more what it has said since
    _write(tmp_path / WATCH, {"kind": "lane", "rows": rows[200:]})
    _write(tmp_path / WATCH, *[{"kind": "said", "time_s": 20.0, "sentence": "ALARM 1 at 20 s"}] * 2)
    shown.look(0.0)
    drawn = charts(shown)
    assert len(drawn["residual"][0]) == 2 * len(drawn["statistic"][0]) >= 400
    assert drawn["residual"][0][-2:] == [(pytest.approx(29.9), -1.0), (pytest.approx(29.9), 2.0)]
    assert drawn["statistic"][1] == [(pytest.approx(10.0, abs=0.11), 1.0), (pytest.approx(29.9), 1.0)]
    assert dict(facts(shown))["watch"] == "ALARM 1 at 20 s; looked at up to 29.9 s"
    replay = Shown(tmp_path, None, "", is_replay=True, cursor_s=10.0, is_playing=False)
    replay.look(0.0)
    assert charts(replay)["statistic"][0][-1][0] == pytest.approx(10.0)
    assert dict(facts(replay))["watch"] == "no alarm"
    _write(tmp_path / WATCH, {"kind": "begin"})
    shown.look(0.0)
    assert charts(shown)["statistic"] == [[], []]


def test_an_investigation_is_shown_by_its_newest_play(tmp_path):
    assert newest_run(tmp_path) is None
    for name in ("01-rest", "02-excitation"):
        (tmp_path / name).mkdir()
        (tmp_path / name / RUN).write_text("")
    assert newest_run(tmp_path) == tmp_path / "02-excitation"
    _write(tmp_path / "journal.jsonl", *({"n": k, "kind": "play", "why": f"reason {k}"} for k in range(12)))
    shown = decisions(tmp_path)
    assert shown[0] == "play: reason 11"
    assert len(shown) == 8


def test_the_board_holds_the_newest_frame(tmp_path):
    path = tmp_path / "frame"
    assert (read_frame(path), frame_number(path)) == (None, -1)
    writer = FrameWriter(path)
    image = np.arange(12, dtype=np.uint8).reshape(3, 4)
    writer.publish(7, 1.5, 2.0, (1.0, 2.0), image)
    writer.publish(8, 1.6, None, None, image[::-1])
    frame = read_frame(path)
    assert frame is not None
    assert (frame.number, frame_number(path)) == (8, 8)
    assert np.isnan(frame.tip_um)
    np.testing.assert_array_equal(frame.image, image[::-1])
    writer.publish(9, 1.7, 1.0, None, np.zeros((30, 40), np.uint8))
    assert frame_number(path) == 8
    writer.close()


@pytest.fixture
def button():
    made = Button(TOKEN)
    serving = server(made)
    thread = threading.Thread(target=serving.serve_forever, daemon=True)
    thread.start()
    yield made, f"http://127.0.0.1:{serving.server_address[1]}"
    serving.shutdown()
    serving.server_close()
    thread.join()


def _ask(url: str, method: str, host: str | None = None) -> tuple[int, bytes]:
    request = urllib.request.Request(url, method=method, headers={} if host is None else {"Host": host})
    try:
        with urllib.request.urlopen(request, timeout=5.0) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read()


def test_the_button_reaches_the_guards_ear(button):
    made, url = button
    with StopEar(TOKEN) as ear:
        made.guard_port = ear.port
        heard = threading.Event()

        def listen() -> None:
            while not ear.heard():
                pass
            heard.set()

        thread = threading.Thread(target=listen, daemon=True)
        thread.start()
        status, body = _ask(f"{url}/{TOKEN}/stop", "POST")
        thread.join(timeout=5.0)
    assert status == 200
    assert heard.is_set()
    assert json.loads(body)["heard"] is True


@pytest.mark.parametrize(
    ("path", "method", "host"),
    few_rows([
        ("/", "GET", None), ("/stop", "POST", None), (f"/{TOKEN[:-1]}/stop", "POST", None), (f"/{TOKEN}", "POST", None),
        (f"/{TOKEN}/stop", "POST", "evil.example:80"), (f"/{TOKEN}/stop", "GET", None),
    ], 0, 1),
)  # fmt: skip
def test_who_does_not_know_the_token_presses_nothing(button, path, method, host):
    made, url = button
    status, body = _ask(url + path, method, host)
    assert (status, body) == (404, b"not found")
    assert made.pressed == 0


def test_the_button_has_a_page_of_its_own_and_says_when_nothing_is_on(button):
    _, url = button
    status, body = _ask(f"{url}/{TOKEN}", "GET")
    assert status == 200
    assert b"STOP" in body
    status, body = _ask(f"{url}/{TOKEN}/stop", "POST")
    assert json.loads(body) == {"heard": False, "said": "no output is on; nothing more will be played"}


def _through_gate(
    kind: str, query: bytes = b"", cookie: bytes = b"", host: bytes = b"127.0.0.1:8000", origin: bytes = b""
) -> list[dict]:
    sent: list[dict] = []

    async def app(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def receive():
        return {"type": "websocket.connect"}

    async def send(message):
        sent.append(dict(message))

    headers = [(b"host", host), *([(b"cookie", cookie)] if cookie else [])]
    headers += [(b"origin", origin)] if origin else []
    scope = {"type": kind, "query_string": query, "headers": headers}
    asyncio.run(TokenGate(app, TOKEN, 8000)(scope, receive, send))
    return sent


KNOWN = b"bender-live-8000=" + TOKEN.encode()


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_the_gate_lets_in_who_knows_the_token(kind):
    assert _through_gate(kind, query=b"token=" + TOKEN.encode())[0]["status"] == 200
    assert _through_gate(kind, cookie=KNOWN)[0]["status"] == 200
    assert _through_gate(kind, cookie=KNOWN, origin=b"http://127.0.0.1:8000")[0]["status"] == 200


def test_the_token_in_the_address_becomes_a_cookie():
    headers = dict(_through_gate("http", query=b"token=" + TOKEN.encode())[0]["headers"])
    assert headers[b"set-cookie"] == KNOWN + b"; HttpOnly; SameSite=Strict; Path=/"
    assert _through_gate("http", cookie=KNOWN)[0]["headers"] == []


@pytest.mark.parametrize(
    "known",
    [
        {}, {"query": b"token="}, {"query": b"token=" + TOKEN[:-1].encode()},
        {"cookie": b"bender-live-1=" + TOKEN.encode()},
        {"cookie": KNOWN[:-1]}, {"cookie": KNOWN, "host": b"evil.example:8000"}, {"cookie": b"=;=;,;\xff"},
        {"cookie": KNOWN, "origin": b"http://127.0.0.1:9000"}, {"cookie": KNOWN, "origin": b"https://evil.example"},
        {"cookie": KNOWN, "origin": b"null"}, {"query": b"token=" + TOKEN.encode(), "origin": b"http://localhost:8000"},
    ],
)  # fmt: skip
def test_the_gate_keeps_out_everybody_else(known):
    first, *_ = _through_gate("http", **known)
    assert first["status"] == 404
    (closed,) = _through_gate("websocket", **known)
    assert closed["type"] == "websocket.close"


def test_a_directory_without_a_run_is_not_replayed(tmp_path, capsys):
    assert main(["live", str(tmp_path)]) == 2
    assert "found no run.jsonl" in capsys.readouterr().err
