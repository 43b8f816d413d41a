"""Parameters as a file: written, read back, and every mistake named with the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.fake_board import FakeBoard, FakeLine
from truing.board.device import Device
from truing.board.parameter_file import read_parameter_file, same_on_the_board, write_parameter_file
from truing.errors import OutputError, ParameterFileError
from truing.link.client import Client


def device_on(board: FakeBoard) -> Device:
    return Device(Client(FakeLine(board)))


def test_what_is_written_is_read_back_as_the_board_had_it(tmp_path: Path) -> None:
    device = device_on(FakeBoard())
    device.set_parameter("wheelbase_m", 0.2912345)
    parameters = device.parameters()
    write_parameter_file(tmp_path / "mine.toml", parameters, "Parameters of a board.")
    read = read_parameter_file(tmp_path / "mine.toml")
    assert list(read) == list(parameters)
    assert all(same_on_the_board(read[name], parameters[name].value) for name in read)
    assert "# m; distance between" in (tmp_path / "mine.toml").read_text()


def test_a_file_may_name_some_parameters_only_and_write_flags_as_true(tmp_path: Path) -> None:
    file = tmp_path / "some.toml"
    file.write_text("[parameters]\nencoder_left_reversed = true\ncounts_per_rev = 64\n")
    assert read_parameter_file(file) == {"encoder_left_reversed": 1.0, "counts_per_rev": 64.0}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("wheelbase_m = 0.3\n", r"there is no table \[parameters\]"),
        ("[parameters]\nwheelbase = 0.3\n", "wheelbase: the board has no such parameter"),
        ("[parameters]\nwheelbase_m = 9\n", "wheelbase_m = 9 lies outside 0.02 to 5 m"),
        ("[parameters]\nwheelbase_m = nan\n", "wheelbase_m: nan is not a finite number"),
        ("[parameters]\nwheelbase_m = '1'\n", "wheelbase_m: '1' is not a finite number"),
        ("[parameters]\nwheelbase_m = true\n", "wheelbase_m: True is not a finite number"),
        ("[parameters]\nlog_rate_hz = 20.5\n", "log_rate_hz = 20.5 is not a whole number"),
        ("[parameters\n", "not valid TOML"),
    ],
)
def test_a_mistake_is_named_with_the_file_and_the_parameter(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(text)
    with pytest.raises(ParameterFileError, match=says) as caught:
        read_parameter_file(file)
    assert str(file) in str(caught.value)


def test_a_mistyped_name_gets_a_suggestion(tmp_path: Path) -> None:
    file = tmp_path / "bad.toml"
    file.write_text("[parameters]\nwheelbase = 0.3\n")
    with pytest.raises(ParameterFileError) as caught:
        read_parameter_file(file)
    assert "wheelbase_m" in caught.value.next_step


def test_a_file_that_is_not_there_and_a_place_that_takes_none_are_named(tmp_path: Path) -> None:
    with pytest.raises(ParameterFileError, match="cannot be read"):
        read_parameter_file(tmp_path / "none.toml")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        write_parameter_file(tmp_path / "file" / "mine.toml", device_on(FakeBoard()).parameters(), "")


def test_the_device_tells_stored_from_live_and_what_a_restart_would_take() -> None:
    device = device_on(FakeBoard())
    assert device.parameters()["wheelbase_m"].stored is None
    device.set_parameter("wheelbase_m", 0.29)
    assert device.save_parameters().written
    assert not device.save_parameters().written
    device.set_parameter("wheelbase_m", 0.31)
    wheelbase = device.parameters()["wheelbase_m"]
    assert (wheelbase.text, wheelbase.is_kept) == ("0.31", False)
    assert wheelbase.after_restart == pytest.approx(0.29)
    assert device.load_parameters() == len(device.parameters())
    assert device.get_parameter("wheelbase_m").text == "0.29"
    device.default_parameters()
    assert device.get_parameter("wheelbase_m").text == "0.283"
    assert device.parameter_store().to_dict()["slots"] == ["good", "blank"]
