# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Who may reach the server of a view, and where it is served."""

import contextlib
import socket
from types import SimpleNamespace
import urllib.error
import urllib.request

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import load_robot
from isotruss_ros.viewer.picture import Picture
import pytest
from robots import examples

viser = pytest.importorskip('viser')
from isotruss_ros.viewer.heartbeat import SCRIPT  # noqa: E402,I100
from isotruss_ros.viewer.server import ViewError  # noqa: E402
from isotruss_ros.viewer.view import View  # noqa: E402
from websockets.exceptions import InvalidStatus  # noqa: E402
from websockets.sync.client import connect  # noqa: E402

ROBOT = load_robot('nine_member')
REFUSED, ACCEPTED = 403, 101
PAGE = b'GET /%b HTTP/1.1\r\nHost: here\r\n%b\r\n'
UPGRADE = b'Connection: Upgrade\r\nUpgrade: websocket\r\n'
TEXTS = st.binary(max_size=30) | st.sampled_from([b'a' * 300, b'%00', b'%ff', b'[', b'..'])
NAMES = [b'Cookie', b'Origin', b'Upgrade', b'Accept-Encoding', b'Host', b'X']
HEADERS = st.lists(st.tuples(st.sampled_from(NAMES), TEXTS), max_size=4)


@contextlib.contextmanager
def served(host):
    with contextlib.closing(View(Picture(ROBOT, 0.3), host, 0)) as view:
        yield view


@pytest.fixture(scope='module')
def local():
    with served('127.0.0.1') as view:
        yield view


@pytest.fixture(scope='module')
def public():
    with served('0.0.0.0') as view:
        yield view


def handshake(view, origin, query='', cookie='', address='127.0.0.1'):
    try:
        with connect(
            f'ws://{address}:{view.server.get_port()}/{query}',
            origin=origin,
            subprotocols=[f'viser-v{viser.__version__}'],
            additional_headers={'Cookie': cookie},
        ):
            return ACCEPTED
    except InvalidStatus as error:
        return error.response.status_code


def fetch(view, query='', address='127.0.0.1'):
    page = f'http://{address}:{view.server.get_port()}/{query}'
    try:
        with urllib.request.urlopen(page, timeout=60) as answer:
            return answer.status, answer.headers
    except urllib.error.HTTPError as error:
        return error.code, error.headers


def token_of(view):
    return '?' + view.address.partition('/?')[2]


@pytest.mark.parametrize('name', ['127.0.0.1', 'localhost'])
def test_a_page_of_this_server_opens_the_websocket_with_its_token(local, name):
    origin = f'http://{name}:{local.server.get_port()}'
    assert handshake(local, origin, token_of(local)) == ACCEPTED
    assert handshake(local, origin) == REFUSED
    assert handshake(local, origin, '?token=guess') == REFUSED


@pytest.mark.parametrize('address', ['127.0.0.1', '127.0.0.2'])
def test_the_page_with_the_token_brings_a_cookie_that_opens_the_websocket(public, address):
    """Two loopback addresses stand for the addresses of the machine in two networks."""
    assert fetch(public, address=address)[0] == REFUSED
    status, headers = fetch(public, token_of(public), address)
    cookie, *attributes = headers['Set-Cookie'].split('; ')
    assert status == 200
    assert headers['X-Frame-Options'] == 'DENY'
    assert {'HttpOnly', 'SameSite=Strict'} <= set(attributes)
    origin = f'http://{address}:{public.server.get_port()}'
    assert handshake(public, origin, cookie=f'other=1; {cookie}', address=address) == ACCEPTED


@pytest.mark.skipif(not socket.has_dualstack_ipv6(), reason='needs IPv6')
@pytest.mark.parametrize('host', ['::ffff:127.0.0.1', '::'])
def test_ipv6_addresses_include_those_of_ipv4(host):
    name = '127.0.0.2' if host == '::' else '127.0.0.1'
    with served(host) as view:
        origin = f'http://{name}:{view.server.get_port()}'
        assert handshake(view, origin, token_of(view), address=name) == ACCEPTED
        assert host == '::' or view.address.startswith(f'{origin}/?token=')


@pytest.mark.parametrize(
    'origin',
    ['http://evil.example', 'null', None, 'http://localhost:1', 'http://127.0.0.3:{port}'],
)
def test_a_page_from_elsewhere_is_refused_the_websocket(local, public, origin):
    for view in (local, public):
        page = origin and origin.format(port=view.server.get_port())
        assert handshake(view, page, token_of(view)) == REFUSED


def test_every_page_has_the_heartbeat_script(local):
    asked = urllib.request.Request(local.address, headers={'Accept-Encoding': 'gzip'})
    with urllib.request.urlopen(asked, timeout=60) as answer:
        assert SCRIPT.encode() in answer.read()


@pytest.mark.parametrize('host', ['127.0.0.1', '203.0.113.7', 'no.such.host', ''])
def test_an_address_that_cannot_be_served_is_refused(local, host):
    port = local.server.get_port()
    with pytest.raises(ViewError, match=f'no server at {host}:{port}: '):
        View(Picture(ROBOT, 0.3), host, port)


def test_an_incompatible_version_of_viser_is_refused(monkeypatch):
    """In another release viser may import its websockets otherwise, beside the gate."""
    import websockets

    own = SimpleNamespace(**vars(websockets))
    own.asyncio = SimpleNamespace(server=SimpleNamespace(serve=websockets.asyncio.server.serve))
    monkeypatch.setattr('viser.infra._infra.websockets', own)
    with pytest.raises(ViewError, match=r'does not check connections: install viser 1\.1\.1'):
        View(Picture(ROBOT, 0.3), '127.0.0.1', 0)


def answer(view, request):
    """Return the status of the answer to the bytes of a request; None without an answer."""
    with socket.create_connection(('127.0.0.1', view.server.get_port()), timeout=60) as client:
        client.sendall(request)
        words = client.recv(1000).split()
    return int(words[1]) if len(words) > 1 else None


@pytest.mark.parametrize(
    'query', [b'?token=\xff', b'?token=%FF', b'?\xff', b'/[?token=', b'?token=%']
)
@pytest.mark.parametrize('header', [b'', b'Cookie: isotruss_view_1=\xff\r\n', UPGRADE])
def test_a_token_of_any_bytes_is_refused(local, query, header):
    assert answer(local, PAGE % (query, header)) == REFUSED


@examples(200)
@given(TEXTS, TEXTS, HEADERS, st.booleans(), st.booleans())
def test_no_request_is_an_error_of_the_server(local, path, query, headers, has_token, upgrades):
    token = token_of(local).encode() + b'&' if has_token else b'?'
    lines = b''.join(b'%b: %b\r\n' % header for header in headers)
    request = PAGE % (path + token + query, lines + UPGRADE * upgrades)
    # Without an answer: no HTTP; 426: no websocket of this version.
    assert answer(local, request) in (200, 400, REFUSED, 404, 426, None)


def test_invalid_http_prints_nothing(local, capfd):
    answer(local, b'\x16\x03\x01\r\n\r\n')
    assert fetch(local, token_of(local))[0] == 200
    assert capfd.readouterr().err == ''
