"""Lets nobody in who does not know the token, over HTTP or a web socket.

The address that a person opens holds the token once; the answer sets a cookie that no script can read and no other
site is sent along with. A request under another name than that of the loopback is refused, whatever it knows: so no
page of another site can be led here by its name.
"""

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

HOSTS = ("127.0.0.1", "localhost")
TOKEN = "token"


class TokenGate:
    """An ASGI middleware.

    Args:
        app: what is behind the gate.
        token: what has to be known.
        port: of the server; its cookie has a name of its own.
    """

    def __init__(self, app: App, token: str, port: int) -> None:
        self._app, self._token, self._cookie = app, token, f"bender-live-{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or end it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {key.lower(): value.decode("latin-1") for key, value in scope.get("headers", [])}
        in_address = self._is_token(parse_qs(scope.get("query_string", b"").decode("latin-1")).get(TOKEN, [""])[0])
        is_known = in_address or self._is_token(self._of_cookie(headers.get(b"cookie", "")))
        host = headers.get(b"host", "")
        is_local = host.rpartition(":")[0] in HOSTS
        # a browser names the page that asks, and sends the cookie for any page of this machine
        is_own = headers.get(b"origin", f"http://{host}") == f"http://{host}"
        if not (is_known and is_local and is_own):
            await _refuse(scope, receive, send)
            return
        await self._app(scope, receive, self._with_cookie(send) if in_address and scope["type"] == "http" else send)

    def _is_token(self, found: str) -> bool:
        return hmac.compare_digest(found.encode("utf-8", "replace"), self._token.encode())

    def _of_cookie(self, header: str) -> str:
        try:
            cookie = SimpleCookie(header)
        except CookieError:
            return ""
        return cookie[self._cookie].value if self._cookie in cookie else ""

    def _with_cookie(self, send: Send) -> Send:
        value = f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/".encode()

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), (b"set-cookie", value)]
            await send(message)

        return sending


async def _refuse(scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})
        return
    await send({"type": "http.response.start", "status": 404, "headers": [(b"content-type", b"text/plain")]})
    await send({"type": "http.response.body", "body": b"not found"})
