# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Server of a view, with access control for its page and websocket.

viser 1.1.1 uses another port if the requested one is taken, hangs if an address cannot be bound,
accepts requests from pages of any origin, lets a page change any attribute of its controls, and
sets asyncio events of its loop from the thread that draws. So this module passes a bound socket to
viser, sets options of `websockets` that viser does not set, and replaces the events. A message
that no page of the view sends is ignored and reported in one line.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
import contextlib
from http import HTTPStatus
import io
import ipaddress
import logging
import os
import secrets
import socket
import sys
import threading
from typing import Any
from urllib.parse import parse_qs

from isotruss_ros.core import IsotrussError
from isotruss_ros.viewer.camera import STYLE
from isotruss_ros.viewer.heartbeat import SCRIPT
from isotruss_ros.viewer.names import LOCAL
from isotruss_ros.viewer.page_messages import check_message
from isotruss_ros.viewer.requests import RequestError
import viser
from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import MultipleValuesError
from websockets.http11 import Request, Response

#: Response headers that prevent other pages from embedding the page, and leaks of its address.
HEADERS = {'X-Frame-Options': 'DENY', 'Referrer-Policy': 'no-referrer'}
#: First lines of the head of the page, with the script of the heartbeat and the style.
HEAD = f'<head>{SCRIPT}{STYLE}'
#: Address reserved for documentation (RFC 5737); a look-up of the route to it, which sends
#: nothing, gives this machine's address.
REMOTE_ADDRESS = ('192.0.2.1', 9)
#: Handler of requests to the server.
Answer = Callable[[ServerConnection, Request], Response | None]
#: Lock of the module `websockets`, which is patched during the start of a server.
_starting = threading.Lock()
#: Logger of connections; it does not print the traceback after an invalid HTTP request.
_quiet = logging.Logger('isotruss_ros.viewer', logging.CRITICAL)


class ViewError(IsotrussError, RuntimeError):
    """Error: the server of a view cannot be started."""


class Gate:
    """
    Access control of a server, which admits only its own pages, opened with a token.

    Other users of this machine can reach the loopback address, so it needs the token as well. A
    page is the server's own if its origin is a name of this machine, or the address at which its
    connection arrived.

    :ivar local: whether only this machine can reach the server.
    :ivar address: address to open in a browser, with the token.
    """

    def __init__(self, bound: socket.socket) -> None:
        host, port = bound.getsockname()[:2]
        served = ipaddress.ip_address(host)
        self.local = served.is_loopback
        self._token, self._port = secrets.token_urlsafe(16), port
        self._cookie = f'isotruss_view_{port}'
        names = {host, LOCAL, 'localhost', '::1'}
        if served.is_unspecified:
            name = socket.gethostname()
            host = _find_address()
            names |= {host, name, f'{name}.local'}
        self._names = names
        self.address = f'http://{_bracket(host)}:{port}/?token={self._token}'

    def guard(self, answer: Answer) -> Answer:
        """
        Return a handler that refuses unauthorised requests.

        :param answer: handler of authorised requests; None for requests to the websocket.
        """

        def answer_or_refuse(connection: ServerConnection, request: Request) -> Response | None:
            if not (self._has_token(request) or self._has_cookie(request)):
                return connection.respond(
                    HTTPStatus.FORBIDDEN, 'Open the address that was printed, with its token.\n'
                )
            # Uncompressed, since script and style are inserted into the page.
            if 'Accept-Encoding' in request.headers:
                del request.headers['Accept-Encoding']
            try:
                response = answer(connection, request)
            except (OSError, ValueError, MultipleValuesError):  # no file has such a name
                return connection.respond(
                    HTTPStatus.BAD_REQUEST, 'Path and headers must be those of a browser.\n'
                )
            if response is None and not self._is_own_page(connection, request):
                return connection.respond(
                    HTTPStatus.FORBIDDEN, 'Only pages of this server open its websocket.\n'
                )
            if response is not None:
                response.body = response.body.replace(b'<head>', HEAD.encode(), 1)
                response.headers.pop('Content-Length', None)
                response.headers['Content-Length'] = str(len(response.body))
                response.headers.update(HEADERS)
                response.headers['Set-Cookie'] = (
                    f'{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict'
                )
            return response

        return answer_or_refuse

    def _is_own_page(self, connection: ServerConnection, request: Request) -> bool:
        """Return whether a websocket is requested by a page of this server."""
        arrival = ipaddress.ip_address(connection.local_address[0].partition('%')[0])
        address = str(getattr(arrival, 'ipv4_mapped', None) or arrival)
        # Browsers omit the default port of HTTP.
        ends = (f':{self._port}', '') if self._port == 80 else (f':{self._port}',)
        origins = [
            f'http://{_bracket(name)}{end}' for name in (*self._names, address) for end in ends
        ]
        return request.headers.get_all('Origin') in [[origin] for origin in origins]

    def _has_token(self, request: Request) -> bool:
        """Return whether the address of a request contains the token."""
        tokens = parse_qs(request.path.partition('?')[2]).get('token', [''])
        return self._is_token(tokens[0])

    def _has_cookie(self, request: Request) -> bool:
        """Return whether a request has the cookie of the page."""
        parts = '; '.join(request.headers.get_all('Cookie')).split('; ')
        values = dict(part.partition('=')[::2] for part in parts)
        return self._is_token(values.get(self._cookie, ''))

    def _is_token(self, text: str) -> bool:
        # Bytes that are not ASCII arrive as surrogates, which have no encoding.
        return secrets.compare_digest(text.encode(errors='replace'), self._token.encode())


class PageConnection(ServerConnection):
    """Websocket that ignores messages that no page of the view sends."""

    async def recv(self, decode: bool | None = None) -> Any:
        """Return the next message that the page of a view may send."""
        while True:
            message = await super().recv(decode)
            try:
                check_message(message)
            except RequestError as error:
                _report(str(error))
            else:
                return message


class LoopEvent(asyncio.Event):
    """Event that any thread may set; its waiters are changed in the thread of its loop alone."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__()
        self._owner = loop

    def set(self) -> None:  # noqa: A003
        """Set the event at the next turn of its loop; a closed loop has no waiters."""
        with contextlib.suppress(RuntimeError):
            self._owner.call_soon_threadsafe(super().set)


class MessageBuffer(AsyncMessageBuffer):
    """Buffer of messages to browsers, into which any thread may put messages."""

    def __init__(self, event_loop: asyncio.AbstractEventLoop, persistent_messages: bool) -> None:
        super().__init__(event_loop, persistent_messages)
        self.message_event, self.flush_event = LoopEvent(event_loop), LoopEvent(event_loop)


def open_server(host: str, port: int) -> tuple[viser.ViserServer, Gate]:
    """
    Start a server; return the server and its access control.

    :param host: address of this machine to bind; 0.0.0.0: all addresses.
    :param port: port of the server; 0: any free port.
    """
    bound = _bind(host, port)
    gate = Gate(bound)
    # viser prints the address without the token.
    _infra.AsyncMessageBuffer = MessageBuffer  # type: ignore[misc]
    with _serving(bound, gate) as served, contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=host, port=port, verbose=False)
    if not served:
        server.stop()
        bound.close()
        raise ViewError(
            f'viser {viser.__version__} does not check connections: install viser 1.1.1'
        )
    return server, gate


def _bind(host: str, port: int) -> socket.socket:
    """Return a listening socket at an address of this machine."""
    where = f'no server at {host}:{port}'
    if '%' in host:
        raise ViewError(
            f'{where}: browsers open no address with a zone: the host must be another address of '
            f'this machine, such as {LOCAL}, or 0.0.0.0 for all of them'
        )
    try:
        # Numeric addresses only: name lookup may be slow.
        family, *_, place = socket.getaddrinfo(
            LOCAL if host == 'localhost' else host,
            port,
            type=socket.SOCK_STREAM,
            flags=socket.AI_NUMERICHOST,
        )[0]
    except OSError as error:
        raise ViewError(
            f'{where}: the host must be an address of this machine, such as {LOCAL}, or 0.0.0.0 '
            'for all of them'
        ) from error
    mapped = getattr(ipaddress.ip_address(place[0]), 'ipv4_mapped', None)
    if mapped is not None:
        family, place = socket.AF_INET, (str(mapped), port)
    everywhere = ipaddress.ip_address(place[0]) == ipaddress.IPv6Address('::')
    try:
        return socket.create_server(place, family=family, dualstack_ipv6=everywhere)
    except OSError as error:
        raise ViewError(f'{where}: {os.strerror(error.errno)}') from error


@contextlib.contextmanager
def _serving(bound: socket.socket, gate: Gate) -> Iterator[list[bool]]:
    """
    Patch `websockets`: servers that start inside the `with` block use this socket and this gate.

    The yielded list is not empty once such a server has started.
    """
    module, served = websockets.asyncio.server, []
    serve = module.serve

    def serve_here(
        handler: Any, _host: str, _port: int, process_request: Answer, **options: Any
    ) -> Any:
        served.append(True)
        asyncio.get_running_loop().set_exception_handler(_report_message)
        return serve(
            handler,
            sock=bound,
            process_request=gate.guard(process_request),
            create_connection=PageConnection,
            logger=_quiet,
            **options,
        )

    with _starting:
        module.serve = serve_here  # type: ignore[assignment, misc]
        try:
            yield served
        finally:
            module.serve = serve  # type: ignore[misc]


def _report_message(_loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Report a message of a page whose handler in viser failed."""
    _report(repr(context.get('exception') or context['message']))


def _report(reason: str) -> None:
    """Print one line about a message of a page."""
    print(f'viewer: message of a page ignored: {reason:.200}', file=sys.stderr, flush=True)


def _find_address() -> str:
    """Return this machine's address in its network, or without network the loopback address."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(REMOTE_ADDRESS)
        except OSError:
            return LOCAL
        return probe.getsockname()[0]


def _bracket(name: str) -> str:
    """Return a host name in the form of a URL."""
    return f'[{name}]' if ':' in name else name
