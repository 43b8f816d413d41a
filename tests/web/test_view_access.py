"""Who may talk to the view, who drives, and what samples a page gets."""

from __future__ import annotations

import asyncio
from itertools import pairwise
from typing import Any

import pytest

from truing.web.access.driver_lock import DRIVER_TIMEOUT_S, DriverLock
from truing.web.access.security import Access, AccessMiddleware, access_for
from truing.web.pose import Pose
from truing.web.worker.sample import LiveHistory, LiveSample, PoseChain


def ask(
    access: Access, kind: str = "http", query: str = "", path: str = "/", **headers: str
) -> tuple[int, dict[str, str]]:
    """Status and headers that the gate answers with; 200 is the application behind it."""
    sent: list[dict[str, Any]] = []

    async def application(_scope: Any, _receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {
        "type": kind,
        "path": path,
        "query_string": query.encode(),
        "headers": [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()],
    }
    asyncio.run(AccessMiddleware(application, access)(scope, None, send))  # type: ignore[arg-type]
    if sent[0]["type"] == "websocket.close":
        return 403, {}
    return sent[0]["status"], {name.decode(): value.decode() for name, value in sent[0]["headers"]}


HERE = access_for("127.0.0.1", 7780)
OPEN = access_for("0.0.0.0", 7780)


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_this_machine_may_come_and_other_sites_pages_may_not(kind):
    host = "127.0.0.1:7780"
    assert HERE.token is None
    assert ask(HERE, kind, host=host)[0] == 200
    assert ask(HERE, kind, host=host, origin="http://127.0.0.1:7780")[0] == 200
    assert ask(HERE, kind, host="localhost:7780", origin="http://localhost:7780")[0] == 200
    for origin in ("http://evil.example", "null", "http://127.0.0.1:7781", "http://localhost:7780"):
        assert ask(HERE, kind, host=host, origin=origin)[0] == 403
    assert ask(HERE, kind, host=host, sec_fetch_site="cross-site", sec_fetch_mode="no-cors")[0] == 403


@pytest.mark.parametrize("host", ["evil.example:7780", "evil.example", "127.0.0.1:1", ""])
def test_a_name_pointed_at_this_machine_is_no_way_in(host):
    assert ask(HERE, host=host)[0] == 403


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_beyond_this_machine_the_token_opens_and_nothing_else_does(kind):
    host = "robot:7780"
    assert OPEN.token is not None
    assert ask(OPEN, kind, host=host)[0] == 403
    assert ask(OPEN, kind, "token=wrong", host=host)[0] == 403
    assert ask(OPEN, kind, host=host, cookie=f"{OPEN.cookie}=wrong")[0] == 403
    assert ask(OPEN, kind, host=host, cookie=f"{OPEN.cookie}={OPEN.token}")[0] == 200
    assert (
        ask(OPEN, kind, host=host, cookie=f"{OPEN.cookie}={OPEN.token}", origin="http://evil.example")[0]
        == 403
    )


def test_the_token_leaves_the_address_for_a_cookie_that_scripts_cannot_read():
    status, headers = ask(OPEN, query=f"token={OPEN.token}", host="robot:7780")
    assert status == 303
    assert headers["location"] == "/"
    assert "HttpOnly" in headers["set-cookie"]
    assert "SameSite=Strict" in headers["set-cookie"]


def test_two_views_have_two_tokens():
    assert access_for("0.0.0.0", 1).token != access_for("0.0.0.0", 1).token


def test_two_views_on_one_machine_keep_their_tokens_apart():
    first, second = access_for("0.0.0.0", 7780), access_for("0.0.0.0", 7781)
    cookies = "; ".join(
        ask(one, query=f"token={one.token}", host="robot:1")[1]["set-cookie"].split(";")[0]
        for one in (first, second)
    )
    assert ask(first, host="robot:7780", cookie=cookies)[0] == 200
    assert ask(second, host="robot:7781", cookie=cookies)[0] == 200


@pytest.mark.parametrize(
    "path",
    ["//evil.example/", "/\\evil.example", "\\\\evil.example", "///evil.example/x", "/a\r\nset-cookie: b"],
)
def test_the_token_is_no_way_to_another_site(path):
    location = ask(OPEN, query=f"token={OPEN.token}", path=path, host="robot:7780")[1]["location"]
    assert location[0] == "/"
    assert location[1] not in "/\\"
    assert "\r" not in location
    assert "\n" not in location


def test_a_page_may_fetch_from_the_view_alone():
    policy = ask(HERE, host="127.0.0.1:7780")[1]["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "http" not in policy


def test_one_drives_and_releasing_control_is_reported():
    left: list[str] = []
    lock = DriverLock(left.append)
    assert lock.claim("a")
    assert not lock.claim("b")
    assert not lock.release("b")
    assert lock.release("a")
    assert left == ["a"]
    assert lock.claim("b")


def test_a_driver_who_falls_silent_loses_the_wheel():
    now = [0.0]
    left: list[str] = []
    lock = DriverLock(left.append, lambda: now[0])
    lock.claim("a")
    now[0] = DRIVER_TIMEOUT_S - 0.1
    lock.refresh("a")
    now[0] += DRIVER_TIMEOUT_S - 0.1
    lock.expire()
    assert lock.holds("a")
    now[0] += 0.2
    lock.expire()
    assert left == ["a"]


def sample(t_s: float, pose: Pose) -> LiveSample:
    return LiveSample(t_s, pose, (0.0, 0.0), (0.0, 0.0), None, None)


def test_a_slow_reader_gets_the_newest_and_an_even_choice():
    history = LiveHistory(capacity=1000)
    history.extend((sample(k, Pose()), Pose()) for k in range(5000))
    found = history.since(0, 100)
    assert len(found) <= 100
    assert found[-1].number == 4999
    steps = {b.number - a.number for a, b in pairwise(found)}
    assert steps == {10}
    assert history.since(5000, 100) == []


def test_odometry_that_begins_anew_goes_on_from_where_the_robot_stands():
    chain = PoseChain(Pose(1.0, 0.0, 0.0))
    chain.place(Pose())
    assert chain.place(Pose(0.5, 0.0, 1.57)).x_m == pytest.approx(1.5)
    again = chain.place(Pose(0.001, 0.0, 0.0))
    assert again.x_m == pytest.approx(1.5, abs=0.01)
    assert again.theta_rad == pytest.approx(1.57)
