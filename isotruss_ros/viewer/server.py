# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The server of a view: a port of its own, and a gate for what asks for its page or its websocket.

viser 1.1.1 passes a port in use by, hangs where an address cannot be bound, and accepts every
origin. It is given a socket that is bound already, and the options of `websockets` that it leaves
out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
from http import HTTPStatus
import io
import ipaddress
import logging
import os
import secrets
import socket
import threading
from typing import Any
from urllib.parse import parse_qs, urlsplit

from isotruss_ros.core import IsotrussError
from isotruss_ros.viewer.camera import STYLE
from isotruss_ros.viewer.heartbeat import SCRIPT
from isotruss_ros.viewer.names import LOCAL
import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

#: Of an answer: no page from elsewhere shows ours in a frame, or reads its address.
HEADERS = {'X-Frame-Options': 'DENY', 'Referrer-Policy': 'no-referrer'}
#: The beginning of a page.
HEAD = f'<head>{SCRIPT}{STYLE}'
#: A documentation address (RFC 5737); asking for the route to it sends nothing.
ELSEWHERE = ('192.0.2.1', 9)
#: Beside the websocket of a page, as viser asks for it.
Answer = Callable[[ServerConnection, Request], Response | None]
#: The module of `websockets` is changed while one server starts.
_starting = threading.Lock()
#: Of connections: the tracebacks of bytes that are no HTTP are not ours.
_quiet = logging.Logger('isotruss_ros.viewer', logging.CRITICAL)


class ViewError(IsotrussError, RuntimeError):
    """The view cannot be served."""


class Gate:
    """
    Who may reach a server: pages of its own, and beyond this machine only with its token.

    :ivar origins: of the pages that may open the websocket, as a browser states them.
    :ivar address: for a browser, with the token where one is asked for.
    :param bound: the socket of the server.
    """

    def __init__(self, bound: socket.socket) -> None:
        host, port = bound.getsockname()[:2]
        served = ipaddress.ip_address(host)
        self._token = '' if served.is_loopback else secrets.token_urlsafe(16)
        self._cookie = f'isotruss_view_{port}'
        names = {host, LOCAL, 'localhost', '::1'}
        if served.is_unspecified:
            name = socket.gethostname()
            host = _find_address()
            names |= {host, name, f'{name}.local'}
        # A browser leaves the port of HTTP out.
        self.origins = sorted(
            f'http://{_bracket(name)}{end}'
            for name in names
            for end in ((f':{port}', '') if port == 80 else (f':{port}',))
        )
        self.address = f'http://{_bracket(host)}:{port}'
        if self._token:
            self.address += f'/?token={self._token}'

    def guard(self, answer: Answer) -> Answer:
        """
        Return what answers requests that pass, and refuses the others.

        :param answer: to those that pass; None to those for the websocket.
        """

        def answer_or_refuse(connection: ServerConnection, request: Request) -> Response | None:
            if not (self._has_token(request) or self._has_cookie(request)):
                return connection.respond(
                    HTTPStatus.FORBIDDEN, 'Open the address that was printed, with its token.\n'
                )
            # As it is, since our script and style go into a page.
            request.headers.pop('Accept-Encoding', None)
            response = answer(connection, request)
            if response is not None:
                response.body = response.body.replace(b'<head>', HEAD.encode(), 1)
                response.headers.pop('Content-Length', None)
                response.headers['Content-Length'] = str(len(response.body))
                response.headers.update(HEADERS)
                if self._token:
                    response.headers['Set-Cookie'] = (
                        f'{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict'
                    )
            return response

        return answer_or_refuse

    def _has_token(self, request: Request) -> bool:
        """Return whether the address of a request has the token."""
        given = parse_qs(urlsplit(request.path).query).get('token', [''])
        return self._is_token(given[0])

    def _has_cookie(self, request: Request) -> bool:
        """Return whether a request has the cookie that came with the page."""
        parts = '; '.join(request.headers.get_all('Cookie')).split('; ')
        values = dict(part.partition('=')[::2] for part in parts)
        return self._is_token(values.get(self._cookie, ''))

    def _is_token(self, given: str) -> bool:
        return secrets.compare_digest(given.encode(), self._token.encode())


class _Server(viser.ViserServer):
    """A server that no page can make public."""

    def request_share_url(self, verbose: bool = True) -> None:
        """Open no tunnel to the network; a page asks for one by a message."""


def open_server(host: str, port: int) -> tuple[viser.ViserServer, str]:
    """
    Return a server, and its address for a browser.

    :param host: address of this machine; 0.0.0.0 for all that it has.
    :param port: of the server; any that is free if 0.
    :raises ViewError: the address cannot be bound, or viser does not serve as it is to.
    """
    bound = _bind(host, port)
    gate = Gate(bound)
    # viser prints an address without the token.
    with _serving(bound, gate) as served, contextlib.redirect_stdout(io.StringIO()):
        server = _Server(host=host, port=port, verbose=False)
    if not served:
        server.stop()
        bound.close()
        raise ViewError(f'viser {viser.__version__} serves without our gate: install viser 1.1.1')
    return server, gate.address


def _bind(host: str, port: int) -> socket.socket:
    """Return a socket that listens."""
    where = f'no server at {host}:{port}'
    try:
        # By number only: looking a name up may take long.
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
    try:
        return socket.create_server(place, family=family)
    except OSError as error:
        raise ViewError(f'{where}: {os.strerror(error.errno)}') from error


@contextlib.contextmanager
def _serving(bound: socket.socket, gate: Gate) -> Iterator[list[bool]]:
    """Serve on a socket, behind a gate, whatever starts a server of `websockets` in a block."""
    module, served = websockets.asyncio.server, []
    serve = module.serve

    def serve_here(
        handler: Any, _host: str, _port: int, process_request: Answer, **options: Any
    ) -> Any:
        served.append(True)
        return serve(
            handler,
            sock=bound,
            origins=gate.origins,  # type: ignore[arg-type]
            process_request=gate.guard(process_request),
            logger=_quiet,
            **options,
        )

    with _starting:
        module.serve = serve_here  # type: ignore[assignment, misc]
        try:
            yield served
        finally:
            module.serve = serve  # type: ignore[misc]


def _find_address() -> str:
    """Return the address of this machine on its network; this machine only without one."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(ELSEWHERE)
        except OSError:
            return LOCAL
        return probe.getsockname()[0]


def _bracket(name: str) -> str:
    """Return a name as it stands in an address."""
    return f'[{name}]' if ':' in name else name
