"""The link over PyVISA against real sockets that misbehave."""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from bender_hil.supply.capability import MODELS
from bender_hil.supply.driver import Supply
from bender_hil.supply.failures import LinkLostError, NoReplyError, SupplyError
from bender_hil.supply.link import LinkSettings, VisaLink
from bender_loop.errors import InputError

pytest.importorskip("pyvisa_py")

IDN = b"B&K Precision, 9115, EMU1, V1\n"


@contextlib.contextmanager
def served(talk: Callable[[socket.socket], None]) -> Iterator[str]:
    """The VISA address of a server whose every connection is handled by `talk`."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        with contextlib.suppress(OSError):
            while True:
                stream, _ = listener.accept()
                with contextlib.suppress(OSError):
                    talk(stream)
                stream.close()

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield f"TCPIP::127.0.0.1::{listener.getsockname()[1]}::SOCKET"
    finally:
        listener.close()


def _link(resource: str) -> VisaLink:
    return VisaLink(LinkSettings(resource, timeout_s=0.1))


def _echo_idn(stream: socket.socket) -> None:
    while stream.recv(100):
        stream.sendall(IDN)


def test_nagles_algorithm_is_off():
    with served(_echo_idn) as resource:
        link = _link(resource)
        link.open()
        inner = link._resource.visalib.sessions[link._resource.session].interface
        assert inner.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        link.close()


def test_a_port_where_nobody_listens_is_lost_and_says_so():
    with socket.create_server(("127.0.0.1", 0)) as unused:
        port = unused.getsockname()[1]
    link = _link(f"TCPIP::127.0.0.1::{port}::SOCKET")
    with pytest.raises(LinkLostError, match=str(port)):
        _open_and_ask(link)


def _open_and_ask(link: VisaLink) -> None:
    # whether opening or asking fails is up to the platform
    link.open()
    link.query("*IDN?")


def test_a_peer_that_goes_away_ends_within_the_timeout():
    with served(lambda stream: None) as resource:
        link = _link(resource)
        link.open()
        start_s = time.perf_counter()
        with pytest.raises(SupplyError):
            link.query("*IDN?")
        assert time.perf_counter() - start_s < 5.0
        link.close()


def test_silence_is_no_reply():
    with served(lambda stream: time.sleep(0.5)) as resource:
        link = _link(resource)
        link.open()
        with pytest.raises(NoReplyError, match="MEAS:VOLT"):
            link.query("MEAS:VOLT?")
        link.close()


def test_a_link_that_is_closed_cannot_be_written():
    link = _link("TCPIP::127.0.0.1::1::SOCKET")
    with pytest.raises(LinkLostError, match="closed"):
        link.write("VOLT 0")
    link.close()


def test_what_is_no_visa_address_is_bad_input():
    with pytest.raises(InputError, match="VISA address"):
        _link("192.168.1.7:5025").open()


def test_reopening_leaves_late_answers_behind():
    """The peer answers one question late on its first connection; on the second all is well."""
    calls: list[int] = []

    def talk(stream: socket.socket) -> None:
        calls.append(0)
        if len(calls) == 1:
            stream.recv(100)
            stream.sendall(IDN)
            stream.recv(100)
            time.sleep(0.3)
            with contextlib.suppress(OSError):
                stream.sendall(b"1\n")
            return
        while data := stream.recv(100):
            for line in data.split(b"\n"):
                if line.endswith(b"?"):
                    stream.sendall(IDN if b"IDN" in line else b"0\n")

    with served(talk) as resource:
        supply = Supply(_link(resource), MODELS["9115"])
        supply.open()
        with pytest.raises(NoReplyError):
            supply.is_on()
        supply.reconnect()
        supply.resync()
        assert supply.confirm_off()
        supply.close()
    assert len(calls) >= 2


@pytest.mark.parametrize(
    ("name", "value"), [("timeout_s", 0.0), ("timeout_s", float("nan")), ("baud", 0), ("spacing_s", -1.0)]
)
def test_settings_out_of_range(name: str, value: float):
    with pytest.raises(ValueError, match=name):
        LinkSettings("ASRL1::INSTR", **{name: value})  # pyright: ignore[reportArgumentType]
