"""Fetches a drive's log and puts it into a recording set as its next run, with all that belongs to it."""

from __future__ import annotations

import datetime
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from truing import __version__
from truing.board.device import Device
from truing.board.state import BoardLog, Parameter, format_f32
from truing.errors import Interrupted, LinkClosed, LinkTimeout, LogError
from truing.floor import MotionModel
from truing.log.columns import run_from_records
from truing.log.decode import DecodedLog, decode_log
from truing.log.download import DownloadReport
from truing.plan import Plan
from truing.progress import Progress
from truing.recording.run import Run, RunMetadata
from truing.recording.writer import next_run_path, replace_file, write_run
from truing.workspace import partial_folder
from truing_protocol import LogEnd

_LOG = logging.getLogger("truing.runs")


@dataclass(frozen=True)
class FetchedLog:
    """A log as it came off the board, decoded."""

    log: BoardLog
    data: bytes
    decoded: DecodedLog
    report: DownloadReport


def fetch_log(device: Device, log_id: int | None = None, progress: Progress | None = None) -> FetchedLog:
    """Download and decode a log (the newest by default); a download cut short is resumed.

    Raises
    ------
    LogError : the board holds no such log, or not one block of it decodes.
    """
    log = device.log(log_id)
    # A virtual board inside this process dies with it: there is nothing to resume later.
    partial = None if device.client.stream.virtual else _partial_path(device, log)
    try:
        data, report = device.read_log(log, partial=partial, progress=progress)
    except (Interrupted, LinkClosed, LinkTimeout) as error:
        if partial is not None:
            error.next_step = (
                f"what has arrived is kept: `truing log fetch {log.log_id}` goes on from there "
                "as long as the board stays switched on"
            )
        raise
    decoded = decode_log(data, log.offset, log.log_id)
    for lost in decoded.lost:
        _LOG.warning("log %d: the block at byte %d is lost: %s", log.log_id, lost.offset, lost.reason)
    if log.truncated and log.end is not LogEnd.TRIGGERED:
        _LOG.warning("log %d: the board's ring has overwritten its beginning", log.log_id)
    if not len(decoded.records):
        raise LogError(
            f"log {log.log_id} holds no readable record", "`truing log list` shows the logs on the board"
        )
    return FetchedLog(log, data, decoded, report)


def other_boots(device: Device) -> list[Path]:
    """Unfinished downloads from this board's earlier starts: their logs are gone with its RAM."""
    folder = partial_folder()
    mine = f"{device.info.board_id}-{device.info.boot_id:08x}-"
    return sorted(p for p in folder.glob(f"{device.info.board_id}-*.part") if not p.name.startswith(mine))


def _partial_path(device: Device, log: BoardLog) -> Path:
    return partial_folder() / f"{device.info.board_id}-{device.info.boot_id:08x}-{log.log_id}.part"


def run_of(
    device: Device,
    fetched: FetchedLog,
    name: str,
    *,
    parameters: dict[str, Parameter],
    plan: Plan | None = None,
    seed: int | None = None,
    clock: dict[str, Any] | None = None,
) -> Run:
    """Return the run that a fetched log is, with its metadata; `clock` is what `clock_stamp` gave."""
    metadata = metadata_of(device, fetched, parameters=parameters, plan=plan, seed=seed)
    if clock is not None:
        metadata.extra["clock"] = clock
    return run_from_records(fetched.decoded.records, name, metadata)


def metadata_of(
    device: Device,
    fetched: FetchedLog,
    *,
    parameters: dict[str, Parameter],
    plan: Plan | None,
    seed: int | None,
) -> RunMetadata:
    """Return everything about a run that its columns do not say.

    For a virtual board in this process it depends on image, plan, robot and seed alone.
    """
    info, log = device.info, fetched.log
    extra: dict[str, Any] = {
        "log": {
            "id": log.log_id,
            "end": log.end.name.lower(),
            "rate_hz": log.rate_hz,
            "records": len(fetched.decoded.records),
            "bytes": len(fetched.data),
            "crc32": f"{fetched.report.crc32:08x}",
            "sequence_crc32": f"{log.sequence_crc:08x}",
            "start_s": log.start_s,
            "end_s": log.end_s,
            "truncated": log.truncated,
            "lost_blocks": [{"offset": lost.offset, "reason": lost.reason} for lost in fetched.decoded.lost],
        },
        "host": {"truing": __version__, "port": info.port},
    }
    if log.end is LogEnd.TRIGGERED:
        extra["trigger"] = trigger_of(device, fetched)
    if not device.client.stream.virtual:
        extra["recorded_at"] = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return RunMetadata(
        firmware={
            "version": info.firmware_version,
            "board": info.board_name,
            "board_id": info.board_id,
            "boot_id": info.boot_id,
            "protocol": info.protocol_version,
            "schema_hash": f"{info.schema_hash:08x}",
            "clock_source": info.clock_source,
            "reset_cause": info.reset_cause,
        },
        parameters={name: float(parameter.text) for name, parameter in parameters.items()},
        plan=plan.to_dict() if plan is not None else {},
        seed=seed,
        pause_before_s=_pause_before(device, fetched),
        extra=extra,
    )


def trigger_of(device: Device, fetched: FetchedLog) -> dict[str, Any] | None:
    """What made the board keep this log, and when in the run; None where it knows of a later trigger only."""
    trigger = device.log_trigger_state()
    if trigger.log_id != fetched.log.log_id or trigger.fired_t_s is None:
        return None
    return trigger.to_dict() | {"run_t_s": round(trigger.fired_t_s - _first_s(fetched), 3)}


def _first_s(fetched: FetchedLog) -> float:
    """When the first record that is there stands, from the log's opening on."""
    return float(fetched.decoded.records["t_ms"][0]) / 1000


def _pause_before(device: Device, fetched: FetchedLog) -> float | None:
    """Device time between the end of the log before and this run's start; None where there was none."""
    log = fetched.log
    if log.log_id <= 1:
        return None
    try:
        return round(log.start_s + _first_s(fetched) - device.log(log.log_id - 1).end_s, 3)
    except LogError:
        return None


def save_run(run: Run, folder: Path, label: str, baseline: str) -> Path:
    """Write `run` as the next of the set in `folder`, and the set's baseline where it has none yet."""
    path = next_run_path(folder, label)
    write_run(run, path)
    if not (folder / "baseline.toml").exists():
        replace_file(folder / "baseline.toml", baseline.encode())
    return path


def motion_model(parameters: dict[str, Parameter]) -> MotionModel:
    """Return what the board's feedforward believes of its wheels: gain 1/kV, time constant kA/kV."""
    values = {name: parameter.value for name, parameter in parameters.items()}
    default = MotionModel()
    gains, constants = [], []
    for side in ("left", "right"):
        kv, ka = values.get(f"ff_kv_{side}", 0.0), values.get(f"ff_ka_{side}", 0.0)
        gains.append(1.0 / kv if kv > 0.01 else default.gain_left_mps)
        constants.append(ka / kv if kv > 0.01 and ka > 0.0 else default.time_constant_s)
    return MotionModel(
        gain_left_mps=gains[0],
        gain_right_mps=gains[1],
        time_constant_s=max(constants),
        wheelbase_m=values.get("wheelbase_m", default.wheelbase_m),
        source="the board's feedforward parameters",
    )


def baseline_text(name: str, parameters: dict[str, Parameter], rate_hz: int) -> str:
    """Return a baseline.toml for a set that has none: the geometry and wheels that the board is set to."""
    model = motion_model(parameters)
    wheel = (
        "[wheel.{side}]\ngain_mps = {gain}  # steady speed per unit effort, m/s\ntime_constant_s = {tau}\n"
    )
    text = [
        "# What the simulation knows of this robot. Written from the board's parameters; the wheels are\n"
        "# what its feedforward believes (1/kV and kA/kV). Put your own simulation's numbers here:\n"
        "# truing never overwrites this file.\n",
        "[robot]",
        f'name = "{name}"',
        f"wheel_radius_m = {parameters['wheel_radius_m'].text}",
        f"wheelbase_m = {parameters['wheelbase_m'].text}",
        f"counts_per_rev = {parameters['counts_per_rev'].text}",
        "",
        wheel.format(
            side="left",
            gain=format_f32(round(model.gain_left_mps, 4)),
            tau=format_f32(round(model.time_constant_s, 4)),
        ),
        wheel.format(
            side="right",
            gain=format_f32(round(model.gain_right_mps, 4)),
            tau=format_f32(round(model.time_constant_s, 4)),
        ),
        "[log]",
        f"rate_hz = {rate_hz}",
        "",
    ]
    return "\n".join(text)
