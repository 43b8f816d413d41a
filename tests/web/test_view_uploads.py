"""Files dropped onto a page: kept by what they are, refused in one line, and never in the way of the link."""

from __future__ import annotations

import asyncio
import json
import socket
import time
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from support.foreign_files import drive, write_sysid, write_wpilog
from truing.errors import FileError
from truing.recording.baseline import read_baseline
from truing.recording.reader import read_run
from truing.web.models.error_model import read_verdict
from truing.web.process.helper import HelperProcess
from truing.web.process.run_cache import RunCache
from truing.web.runs.arrivals import Wishes, store
from web.synthetic_runs import BASELINE, VERDICT, synthetic_set
from web.upload_load import measure, post, recording
from web.view_process import ViewProcess


def stored(tmp_path, name: str, data: bytes, wishes: Wishes | None = None):
    part = tmp_path / "arriving" / Path(name).name
    part.parent.mkdir(exist_ok=True)
    part.write_bytes(data)
    return store(name, part, tmp_path / "dropped", tmp_path / "diagnoses", wishes)


def test_dropped_files_are_kept_by_what_they_are(tmp_path):
    data = (synthetic_set(tmp_path / "made") / "runs/01_straight.csv").read_bytes()
    dropped, diagnoses = tmp_path / "dropped", tmp_path / "diagnoses"
    kept = dropped / "01_straight/runs/01_straight.csv"
    assert stored(tmp_path, "../../01_straight.csv", data)["path"] == str(kept)
    own = Wishes("01_straight")
    assert stored(tmp_path, "baseline.toml", BASELINE.encode(), own)["kind"] == "baseline"
    assert stored(tmp_path, "02.csv", data, own)["path"] == str(kept.with_name("02.csv"))
    assert stored(tmp_path, "01_straight.csv", data)["set"] == "01_straight-2"
    assert stored(tmp_path, "v.json", json.dumps(VERDICT).encode())["kind"] == "diagnosis"
    assert read_verdict(diagnoses / "v.json")["name"] == "made"
    assert "error" in stored(tmp_path, "01_straight.csv", b"not a run")
    assert kept.read_bytes() == data
    assert "error" in stored(tmp_path, "y.json", b'{"verdict": 1}')
    assert not (diagnoses / "y.json").exists()
    assert "error" in stored(tmp_path, "x.toml", b"= =")
    assert read_baseline(dropped / "01_straight/baseline.toml").left.gain_mps == 1.45
    with pytest.raises(FileError):
        read_verdict(tmp_path / "nowhere.json")


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("x.csv", b"not a run"),
        ("x.csv", bytes(range(256)) * 40),
        ("x.csv", b""),
        ("x.toml", b"= ="),
        ("x.json", b"{"),
        pytest.param("x.json", b"[" * 200_000, id="deep list"),
        pytest.param("x.json", b'{"a":' * 50_000, id="deep table"),
        ("x.json", b'"' + b"\xff" * 100 + b'"'),
    ],
)
def test_a_hostile_file_is_refused_in_one_line_that_names_it(tmp_path, name, data):
    error = stored(tmp_path, name, data)["error"]
    assert error.startswith("x.")
    assert "\n" not in error
    assert len(error) < 300
    assert "arriving" not in error


TABLE = "\n".join(
    ["time,pwmL,pwmR,speedL,speedR"]
    + [
        f"{0.05 * k:.2f},{60 + k % 7},{60 + k % 5},{0.2 + 0.001 * k:.4f},{0.2 + 0.001 * k:.4f}"
        for k in range(60)
    ]
)


def test_a_table_of_another_program_is_asked_about_once(tmp_path):
    asked = stored(tmp_path, "bench.csv", TABLE.encode())
    assert asked["ask"] == "mapping"
    assert [column[0] for column in asked["columns"]] == ["time", "pwmL", "pwmR", "speedL", "speedR"]
    assert not (tmp_path / "dropped").exists()
    mapping = """
[columns]
t_s = "time"
effort_left = { expression = "pwmL / 255" }
effort_right = { expression = "pwmR / 255" }
vel_left_mps = "speedL"
vel_right_mps = "speedR"
"""
    found = stored(tmp_path, "bench.csv", TABLE.encode(), Wishes(mapping=mapping))
    assert found["set"] == "bench"
    run = read_run(found["path"])
    assert run.columns["effort_left"][0] == pytest.approx(60 / 255)
    # The next table of the same set needs no question.
    assert stored(tmp_path, "bench2.csv", TABLE.encode(), Wishes("bench"))["kind"] == "run"
    assert len(list((tmp_path / "dropped/bench/runs").glob("*.csv"))) == 2
    wrong = stored(tmp_path, "bench.csv", TABLE.encode(), Wishes(mapping="[columns\n"))
    assert "not TOML" in wrong["error"]


def test_a_file_of_a_known_program_is_imported_as_on_the_command_line(tmp_path):
    sysid = write_sysid(tmp_path / "drive.json").read_bytes()
    found = stored(tmp_path, "drive sysid.json", sysid)
    assert found["set"] == "drive_sysid"
    assert found["runs"] == 4
    assert abs(read_run(found["path"]).columns["effort_left"]).max() > 0.1
    assert found["findings"]


def test_a_bag_with_body_speeds_asks_for_the_wheelbase_and_takes_it(tmp_path):
    pytest.importorskip("rosbags")
    from host.test_import_bags import write_drive

    bag = write_drive(tmp_path, "ros1").read_bytes()
    asked = stored(tmp_path, "drive.bag", bag)
    assert asked["ask"] == "numbers"
    assert list(asked["numbers"]) == ["wheelbase_m"]
    found = stored(
        tmp_path, "drive.bag", bag, Wishes(numbers=(("wheelbase_m", 0.35), ("metres_per_unit", 0.05)))
    )
    assert found["set"] == "drive"


def test_what_a_page_says_of_a_file_is_taken_by_name_and_in_reason():
    query = {
        "set": "../../x",
        "wheelbase_m": "0.3",
        "metres_per_unit": "-1",
        "full_speed_mps": "a",
        "name": "n",
    }
    assert Wishes.of_query(query) == Wishes("x", "", (("wheelbase_m", 0.3),))


def test_runs_that_were_read_are_forgotten_once_they_take_too_much_memory(tmp_path):
    files = sorted((synthetic_set(tmp_path) / "runs").glob("*.csv"))
    cache = RunCache(max_bytes=20_000)
    first = cache.read(files[0])
    assert cache.read(files[0]) is first
    for file in files[1:]:
        cache.read(file)
    assert cache.bytes <= 20_000
    assert cache.read(files[0]) is not first


def test_a_helper_that_has_needed_much_memory_ends_once_nobody_asks_it(tmp_path, monkeypatch):
    monkeypatch.setattr("truing.web.process.helper._LARGE_MB", 1.0)
    monkeypatch.setattr("truing.web.process.helper._IDLE_S", 0.2)
    helper = HelperProcess("truing.web.process.arrival_main")
    request = {"name": "x.csv", "part": "x", "dropped": "d", "diagnoses": "d", "query": {}}
    with pytest.raises(Exception, match=r"x\.csv|no such file"):
        asyncio.run(helper.ask(request))
    until = time.monotonic() + 20.0
    while helper.is_running and time.monotonic() < until:
        time.sleep(0.05)
    assert not helper.is_running


@pytest.fixture(scope="module")
def view(tmp_path_factory, image, native_library):
    made = ViewProcess(tmp_path_factory.mktemp("view") / "out")
    yield made
    made.close()


def begin_upload(view: ViewProcess, size: int) -> socket.socket:
    """A connection on which an upload of that size has been announced."""
    where = urlsplit(view.address)
    raw = socket.create_connection((where.hostname, where.port), timeout=30)
    head = f"POST /dropped?name=x.csv HTTP/1.1\r\nHost: {where.netloc}\r\nContent-Length: {size}\r\n\r\n"
    raw.sendall(head.encode())
    return raw


@pytest.mark.slow
def test_a_file_that_is_too_large_is_refused_before_it_is_sent(view):
    from truing.web.runs.dropped_files import MAX_BYTES  # brings fastapi

    with begin_upload(view, MAX_BYTES + 50_000_000) as raw:
        answer = b""
        while b"}" not in answer and (got := raw.recv(4096)):
            answer += got
    assert answer.startswith(b"HTTP/1.1 413")
    assert b"x.csv: 250 MB; a page takes files of up to 200 MB" in answer


@pytest.mark.slow
def test_a_wpilog_that_is_dropped_is_imported_by_the_server(view, tmp_path):
    log = write_wpilog(tmp_path / "FRC_20260101.wpilog")
    found = post(view.address, log, log.name)
    assert found["kind"] == "run", found
    assert found["set"] == "FRC_20260101"
    assert found["runs"] == 4
    runs = sorted((view.out / "dropped/FRC_20260101/runs").glob("*.csv"))
    assert len(runs) == 4
    assert abs(read_run(runs[0]).columns["vel_left_mps"]).max() > 0.1
    cut = tmp_path / "cut.wpilog"
    cut.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    assert any("ends" in text for text in post(view.address, cut, cut.name)["findings"])


@pytest.mark.slow
def test_a_dropped_mcap_asks_which_message_is_which_and_takes_the_answer(view, tmp_path):
    pytest.importorskip("mcap")
    from host.test_import_bags import MCAP_MAPPING, write_json_mcap

    log = write_json_mcap(tmp_path / "drive.mcap")
    asked = post(view.address, log, log.name)
    assert asked["ask"] == "mapping", asked
    names = [column[0] for column in asked["columns"]]
    assert {"/wheels.log_time", "/wheels.left.speed", "/drive.effort.0"} <= set(names)
    assert "log_time" in asked["toml"]
    assert not (view.out / "dropped/drive").exists()
    wrong = post(view.address, log, log.name, mapping=MCAP_MAPPING.replace("/drive.effort.0", "/drive.u"))
    assert "/drive.effort.0" in wrong["error"], "what there is is named"
    found = post(view.address, log, log.name, mapping=MCAP_MAPPING)
    assert found["kind"] == "run", found
    speed = read_run(found["path"]).columns["vel_left_mps"]
    assert speed.max() == pytest.approx(0.297, abs=0.02)


@pytest.mark.slow
def test_a_dropped_mat_file_is_taken_as_it_is_or_proposed(view, tmp_path):
    import scipy.io

    truth = drive("fast-forward")
    effort = truth.volts / 12.0
    own = {f"effort_{side}": effort for side in ("left", "right")}
    own |= {f"vel_{side}_mps": truth.speed for side in ("left", "right")}
    scipy.io.savemat(tmp_path / "own.mat", {"t_s": truth.t, **own})
    assert post(view.address, tmp_path / "own.mat", "own.mat")["kind"] == "run"
    log = {"time": truth.t, "pwmL": 255 * effort, "pwmR": 255 * effort}
    log |= {"speedL": truth.speed, "speedR": truth.speed}
    scipy.io.savemat(tmp_path / "bench.mat", {"log": log})
    asked = post(view.address, tmp_path / "bench.mat", "bench.mat")
    assert asked["ask"] == "mapping", asked
    assert "log.pwmL" in [column[0] for column in asked["columns"]]
    found = post(view.address, tmp_path / "bench.mat", "bench.mat", mapping=asked["toml"])
    assert found["kind"] == "run", found
    taken = read_run(found["path"])
    assert taken.columns["effort_left"] == pytest.approx(effort, abs=1e-4)
    (tmp_path / "cut.mat").write_bytes((tmp_path / "bench.mat").read_bytes()[:300])
    assert post(view.address, tmp_path / "cut.mat", "cut.mat")["error"].startswith("cut.mat: ")


@pytest.mark.slow
def test_an_upload_that_breaks_off_leaves_nothing_and_the_next_one_is_taken(view, tmp_path):
    for _ in range(3):
        with begin_upload(view, 10_000_000) as raw:
            raw.sendall(b"t_s,effort_left\n" * 10_000)
    run = synthetic_set(tmp_path) / "runs/02_straight.csv"
    assert post(view.address, run, run.name)["kind"] == "run"
    assert (view.out / "dropped/02_straight/runs/02_straight.csv").read_bytes() == run.read_bytes()
    assert not list((view.out / "dropped/.incoming").iterdir())
    connection = HTTPConnection(urlsplit(view.address).netloc, timeout=30)
    connection.request("POST", "/dropped?name=deep.json", b"[" * 300_000)
    assert "nested too deeply" in json.loads(connection.getresponse().read())["error"]
    connection.close()


@pytest.mark.slow
@pytest.mark.usefixtures("image", "native_library")
def test_stops_and_frames_go_on_while_a_recording_of_100_mb_arrives_and_memory_comes_back(tmp_path):
    """`upload_load.py` measures the bars (0.15 s, 0.3 s) on a machine that does nothing else."""
    found = measure(tmp_path / "out", recording(tmp_path / "large.csv", 100))
    assert found.answer["kind"] == "run", found
    assert found.stops >= 2
    assert found.stop_s < 1.0, found
    assert found.gap_s < 1.5, found
    assert found.grown_mb < 50.0, found
