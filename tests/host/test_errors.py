"""Errors survive the way between processes, whatever they carry."""

from __future__ import annotations

import pickle

from truing.errors import FileError, TruingError


def test_an_error_of_a_worker_process_arrives_whole() -> None:
    error = FileError("runs/a.csv", "cannot be read", "Check the path")
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is FileError
    assert (str(copy), copy.path, copy.next_step) == (str(error), error.path, "Check the path")
    assert copy.exit_code == TruingError.exit_code
