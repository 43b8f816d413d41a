"""Makes the five ugly files beside it, of a robot and a motor whose numbers are known: `python make.py`."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
HERE = Path(__file__).parent
# What the tests find again: steady speed at full effort (m/s; rad/s of the motor) and time constant (s).
GAIN_LEFT, GAIN_RIGHT, TAU_S = 1.20, 1.26, 0.25
MOTOR_GAIN, MOTOR_TAU_S = 300.0, 0.12
WHEELBASE_M = 0.24
METRES_PER_COUNT = 2.0 * np.pi * 0.03 / 1440.0


def drive(
    gain: float, tau: float, seed: int, rate_hz: float, seconds: float = 12.0
) -> tuple[Array, Array, Array]:
    """Time; effort and mean speed of the interval before each row."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 12.0, 1.0 / rate_hz)
    effort = np.zeros(len(t))
    hold = int(1.2 * rate_hz)
    for k in range(int(0.5 * rate_hz), len(t), hold):
        effort[k : k + hold] = rng.choice([-0.6, -0.4, 0.0, 0.3, 0.5, 0.7])
    keep = np.exp(-1.0 / rate_hz / tau)
    speed, now = np.zeros(len(t)), 0.0
    for k in range(1, len(t)):
        steady = gain * effort[k]
        speed[k] = steady + (now - steady) * tau * rate_hz * (1.0 - keep)
        now = steady + (now - steady) * keep
    return t, effort, speed


def main() -> None:
    """Write the files."""
    t, left, v_left = drive(GAIN_LEFT, TAU_S, 1, 25.0)
    _, right, v_right = drive(GAIN_RIGHT, TAU_S, 2, 25.0)

    # A spreadsheet: comments, decimal commas, ISO times, a row of units, per cent, a last semicolon.
    begin = datetime(2024, 5, 17, 9, 30, 12, tzinfo=UTC)
    lines = [
        "# bench log",
        "# exported by LogView 3.2",
        "Zeit;Links Duty;Rechts Duty;vel left;vel right;Notiz;",
    ]
    lines.append("[];[%];[%];[m/s];[m/s];[];")
    for row in zip(t, 100 * left, 100 * right, v_left, v_right, strict=True):
        stamp = (begin + timedelta(seconds=float(row[0]))).isoformat(timespec="milliseconds")
        cells = [f"{value:.4f}".replace(".", ",") for value in row[1:]]
        lines.append(";".join([stamp, *cells, "ok", ""]))
    (HERE / "decimal_comma.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")

    # What a microcontroller prints: no header, any number of spaces, milliseconds, 8-bit PWM, counts.
    counts = [np.round(np.cumsum(v) / 25.0 / METRES_PER_COUNT).astype(int) for v in (v_left, v_right)]
    rows = zip(t, np.round(255 * left).astype(int), np.round(255 * right).astype(int), *counts, strict=True)
    text = "\n".join(
        f"  {48_211 + round(1e3 * a)}   {b:4d} {c:4d}   {d:6d}  {e:6d}" for a, b, c, d, e in rows
    )
    (HERE / "no_header.txt").write_text(text + "\n", encoding="utf-8")

    # A motor on a bench: the header is a comment, volts, rpm, cells without a number.
    s, u, w = drive(MOTOR_GAIN, MOTOR_TAU_S, 3, 50.0)
    lines = ["% dyno 2, run 14", "% t_ms  voltage_V  speed_rpm"]
    for k, (a, b, c) in enumerate(zip(1e3 * s, 12 * u, w * 30 / np.pi, strict=True)):
        lines.append(f"{a:.0f}\t{b:.3f}\t{'nan' if k % 97 == 50 else f'{c:.2f}'}")
    (HERE / "motor_bench.dat").write_text("\n".join(lines) + "\n", encoding="utf-8")

    # A recorder with a preamble, two drives in one file, a position at 5 Hz that is lost for a second.
    heading = np.cumsum((v_right - v_left) / WHEELBASE_M) / 25.0
    x, y = (np.cumsum(0.5 * (v_left + v_right) * f(heading)) / 25.0 for f in (np.cos, np.sin))
    lines = [
        "Recorder: roverlog",
        "Operator: -",
        "",
        "elapsed (s),dutyL,dutyR,encL,encR,mocap x [mm],mocap y [mm],phase",
    ]
    for k in range(len(t)):
        seen = k % 5 == 0 and not 100 <= k < 130
        pose = f"{1e3 * x[k]:.1f},{1e3 * y[k]:.1f}" if seen else ","
        phase = "warmup" if k < 100 else "drive"
        lines.append(f"{t[k]:.3f},{left[k]:.3f},{right[k]:.3f},{counts[0][k]},{counts[1][k]},{pose},{phase}")
    (HERE / "mocap_gaps.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")

    # A body's motion instead of its wheels', microseconds, a timer that counts to 400, a line cut off.
    lines = ["stamp [us]\tpwmLeft\tpwmRight\tv\tw"]
    forward, turn = 0.5 * (v_left + v_right), (v_right - v_left) / WHEELBASE_M
    for a, b, c, d, e in zip(1e6 * t, 400 * left, 400 * right, forward, turn, strict=True):
        lines.append(f"{7_000_000 + a:.0f}\t{b:.0f}\t{c:.0f}\t{d:.5f}\t{e:.5f}")
    lines.append("19001")
    (HERE / "body_twist.tsv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
