"""Requests accepted as the page's own, by the headers that browsers send (Fetch standard: Origin, Sec-Fetch-*)."""

import asyncio

import pytest

pytest.importorskip("starlette", reason="starlette, which nicegui of the extra app brings, is not installed")

from adapt.cli.local_page.own_origin import HEADERS, OwnOrigin, is_foreign

HOST = {b"host": b"127.0.0.1:8080"}


@pytest.mark.parametrize(
    ("headers", "foreign"),
    [
        ({}, False),
        ({b"origin": b"http://127.0.0.1:8080"}, False),
        ({b"origin": b"http://127.0.0.1:8081"}, True),
        ({b"origin": b"http://localhost:8080"}, True),
        ({b"origin": b"https://127.0.0.1:8080"}, True),
        ({b"origin": b"null"}, True),
        ({b"sec-fetch-site": b"none"}, False),
        ({b"sec-fetch-site": b"same-origin", b"sec-fetch-dest": b"iframe"}, False),
        ({b"sec-fetch-site": b"same-site"}, True),
        ({b"sec-fetch-site": b"cross-site", b"sec-fetch-mode": b"navigate", b"sec-fetch-dest": b"document"}, False),
        ({b"sec-fetch-site": b"cross-site", b"sec-fetch-mode": b"navigate", b"sec-fetch-dest": b"iframe"}, True),
        ({b"sec-fetch-site": b"cross-site", b"sec-fetch-mode": b"no-cors", b"sec-fetch-dest": b"image"}, True),
    ],
)
def test_who_asks(headers, foreign):
    assert is_foreign(HOST | headers) == foreign


def answers(kind: str, headers: dict[bytes, bytes]) -> list[dict]:
    """Return the messages sent for a request to an application that sets a policy header of its own."""
    sent: list[dict] = []

    async def inner(_scope, _receive, send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-security-policy", b"own")]})

    async def receive() -> dict:
        raise AssertionError("nothing is read of what is refused")

    async def send(message) -> None:
        sent.append(message)

    asyncio.run(OwnOrigin(inner)({"type": kind, "headers": [*(HOST | headers).items()]}, receive, send))
    return sent


def test_a_foreign_socket_is_closed_before_it_opens():
    assert answers("websocket", {b"origin": b"null"}) == [{"type": "websocket.close", "code": 1008}]
    assert answers("http", {b"origin": b"null"})[0]["status"] == 403


def test_headers_are_added_to_those_of_an_answer():
    (start,) = answers("http", {})
    assert dict(start["headers"]) == HEADERS | {b"content-security-policy": b"own"}
