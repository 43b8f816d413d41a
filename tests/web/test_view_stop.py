"""A stop stays pending until the board has acknowledged it, whatever else happens."""

from __future__ import annotations

from truing.web.worker.shared import DriveCommand, SharedState


def test_a_stop_is_pending_until_it_is_acknowledged():
    shared = SharedState()
    number = shared.request_stop("test")
    assert shared.take_requests().stop == number
    # The board did not answer: the next step tries again.
    assert shared.stop_pending
    assert shared.take_requests().stop == number
    shared.drop_requests()
    assert shared.stop_pending
    shared.acknowledge_stop(number)
    assert not shared.stop_pending
    assert shared.stop_acknowledged == number


def test_a_newer_stop_is_not_acknowledged_by_an_older_one():
    shared = SharedState()
    first = shared.request_stop("first")
    second = shared.request_stop("second")
    shared.acknowledge_stop(first)
    assert shared.stop_pending
    assert shared.take_requests().stop == second


def test_no_drive_command_is_taken_while_a_stop_is_pending():
    shared = SharedState()
    number = shared.request_stop("test")
    shared.request_drive(DriveCommand(0.1, 0.1, 1e9))
    assert shared.take_requests().drive is None
    shared.acknowledge_stop(number)
    shared.request_drive(DriveCommand(0.1, 0.1, 1e9))
    assert shared.take_requests().drive is not None


def test_a_key_held_through_a_lost_link_drives_again_only_after_its_release():
    shared = SharedState()
    held, released = DriveCommand(0.3, 0.3, 10.0), DriveCommand(0.0, 0.0, 10.0)
    shared.request_drive(held)
    shared.drop_requests()
    shared.request_drive(held)
    assert shared.take_requests().drive is None
    shared.request_drive(released)
    shared.request_drive(held)
    assert shared.take_requests().drive == held
