import socket
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.shell.messages import Channel, ClosedError, Listener, call

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
