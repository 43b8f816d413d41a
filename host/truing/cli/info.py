"""`truing info`: who the board is, and how it is."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.cli.options import board_options

if TYPE_CHECKING:
    from truing.board.device import Device


@click.command()
@board_options
def command(app: App) -> None:
    """Say who the board is and how it is: firmware, state, supply, encoders, faults by name.

    \b
    Example:
      truing --port /dev/ttyUSB0 info
    """
    with app.open_device() as device:
        info, status, record = device.info, device.status(), device.fault_record()
        limit = _thermal_limit(device)
        slots = device.image_slots()
    app.emit(
        {
            "board": asdict(info),
            "status": status.to_dict(),
            "fault_record": record and asdict(record),
            "image_slots": [slot.to_dict() for slot in slots],
        }
    )
    battery = "not measured" if status.battery_v is None else f"{status.battery_v:.2f} V"
    app.say(f"{info.board_name}, firmware {info.firmware_version}, on {info.port}")
    app.say(f"  board id      {info.board_id}")
    app.say(
        f"  boot          {info.boot_id:08x}, {status.uptime_s:.1f} s ago, "
        f"cause: {info.reset_cause}, clock: {info.clock_source}"
    )
    app.say(
        f"  protocol      {info.protocol_version}, schema {info.schema_hash:08x}, the same as this truing's"
    )
    app.say(f"  state         {status.state.name.lower()}; sequence {status.sequence_state.name.lower()}")
    app.say(f"  supply        {battery}")
    app.say(f"  motors        {limit}")
    app.say(f"  encoders      left {status.counts[0]}, right {status.counts[1]} counts since start-up")
    if any(status.stray_edges):
        left, right = status.stray_edges
        app.say(f"                left {left}, right {right} edges without a count: noise on their lines")
    app.say(f"  effort        left {status.effort[0]:+.4f}, right {status.effort[1]:+.4f}")
    app.say(f"  speed         left {status.speed_mps[0]:+.3f}, right {status.speed_mps[1]:+.3f} m/s")
    app.say(f"  pose          x {status.x_m:.3f} m, y {status.y_m:.3f} m, theta {status.theta_rad:.4f} rad")
    for number, slot in enumerate(slots):
        app.say(f"  image slot {number}  {slot.text()}")
    app.say(f"  log memory    {info.log_bytes / 1024:g} KiB")
    app.say(f"  line          {status.frames_dropped} damaged frames received by the board")
    if not status.active and not status.latched:
        app.say("  faults        none")
    for fault in dict.fromkeys(status.latched + status.active):
        kind = "latched, wheels stopped" if fault in status.latched else "active"
        app.say(f"  fault         {fault.name} ({kind}): {fault.cause}")
        app.say(f"    next:       {fault.next_step}")
    for number, line in enumerate(record.lines() if record else []):
        app.say(("  fault record  " if number == 0 else "                ") + line)


def _thermal_limit(device: Device) -> str:
    names = ("motor_resistance_ohm", "motor_continuous_a")
    resistance_ohm, current_a = (float(device.get_parameter(name).value) for name in names)
    if resistance_ohm > 0 and current_a > 0:
        return f"thermal limit: {current_a:g} A for ever"
    return f"no thermal limit: {' and '.join(names)} are not both known"
