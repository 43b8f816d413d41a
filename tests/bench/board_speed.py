"""How fast the virtual board runs the flashed image, as a ratio to a bare image, and where the time goes."""

from __future__ import annotations

import subprocess
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import unicorn
from rich.console import Console

from bench.figure import Figure
from hil_sim import VirtualRobot
from hil_sim.robot import Phase
from truing.board.device import Device
from truing.board.drive import drive
from truing.link.client import Client
from truing.link.framing import Frame, FrameDecoder, encode
from truing.link.virtual_stream import VirtualStream
from truing.plan import load_plan
from truing_protocol import REPLY_BIT, LogReadRequest, StatusRequest

PLAN = "paper/XI"
# ArduPilot's account of Renode's STM32F405: 5 to 33 times slower than real time; the better end is the peer.
RENODE = "Renode's F405 (ArduPilot), at best"
RENODE_SPEED = 1 / 5
BARE = Path(__file__).parent / "bare_board"
BARE_S = 20.0  # virtual
CPU = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")
DEMO_BAR, FULL_BAR = 0.2, 0.04  # of the bare image's speed, measured in the same run
LINE_BYTES_PER_S = 921_600 / 10
SLICE_US = 1000
SAMPLE_S = 0.0005
# The best of these counts: other programs on the machine only ever slow a run down.
ROUNDS = 3


def measure(root: Path) -> list[Figure]:
    """Drive the demo's plan as a user does, with both lanes of the link full, and asked for too much.

    Speeds are virtual seconds per second of CPU time, so that other programs on the machine count little.
    """
    image = root / "build/stm32f405/firmware/truing-f405.elf"
    bare = _bare_speed(root / "out" / "bench")
    full = _best(lambda: _drive_saturated(image, reads_under_way=4, filler=_broken_frame()))
    sampled = _drive_saturated(image, reads_under_way=4, filler=_broken_frame(), sample=True)
    flooded = _best(lambda: _drive_saturated(image, reads_under_way=4, filler=_frame(StatusRequest(), 0)))
    demo = max((_demo(image) for _ in range(ROUNDS)), key=lambda one: one.speed)
    bare = max(bare, _bare_speed(root / "out" / "bench"))
    _print_shares(demo, sampled)
    return [
        Figure("bare 1 kHz image", bare, "x real time", "more"),
        _speed(f"virtual board, {PLAN}", demo.speed),
        _share(f"virtual board, {PLAN}, of the bare image", demo.speed / bare, DEMO_BAR),
        _speed("virtual board, link saturated", full.speed),
        _share("virtual board, link saturated, of the bare image", full.speed / bare, FULL_BAR),
        _lane("its link, host to board", full.received_bytes_per_s),
        _lane("its link, board to host", full.sent_bytes_per_s),
        _speed("virtual board, more asked than the line can answer", flooded.speed),
    ]


def _speed(name: str, value: float) -> Figure:
    return Figure(name, value, "x real time", "more", None, RENODE, RENODE_SPEED)


def _share(name: str, value: float, bar: float) -> Figure:
    return Figure(name, value, "of its speed", "more", bar)


def _lane(name: str, bytes_per_s: float) -> Figure:
    return Figure(name, bytes_per_s / 1e3, "kB/s", "more", peer="the line", peer_value=LINE_BYTES_PER_S / 1e3)


def _bare_speed(out: Path) -> float:
    """Virtual seconds per second of a bare image on a bare emulator, the best of some runs."""
    out.mkdir(parents=True, exist_ok=True)
    elf, flat, emulator = out / "bare.elf", out / "bare.bin", out / "bare"
    engine = Path(unicorn.__file__).parent
    library = engine / "lib" / "libunicorn.so.2"
    script, source = str(BARE / "image.ld"), str(BARE / "image.c")
    options = ("-O2", "-ffreestanding", "-nostdlib", "-Wl,--build-id=none,--entry=0x08000000", "-T", script)
    linked = (f"-I{engine / 'include'}", str(library), f"-Wl,-rpath,{library.parent}")
    for command in (
        ("arm-none-eabi-gcc", *CPU, *options, source, "-o", str(elf)),
        ("arm-none-eabi-objcopy", "-O", "binary", "-j", ".text", str(elf), str(flat)),
        ("gcc", "-O2", str(BARE / "emulator.c"), *linked, "-o", str(emulator)),
    ):
        subprocess.run(command, check=True)
    run = (str(emulator), str(flat), str(BARE_S))
    spans = [float(subprocess.run(run, check=True, capture_output=True, text=True).stdout) for _ in range(5)]
    return BARE_S / min(spans)


@dataclass(frozen=True)
class Drive:
    """What a drive came to; `speed` in virtual seconds per second of CPU time, shares of it by name."""

    speed: float
    shares: dict[str, float]
    received_bytes_per_s: float = 0.0
    sent_bytes_per_s: float = 0.0


NAMES = {
    Phase.OUTSIDE: "Python",
    Phase.CODE: "code",
    Phase.INTERRUPTS: "interrupts",
    Phase.PERIPHERALS: "peripherals",
    Phase.PLANT: "plant",
}


@contextmanager
def _sampled(robot: VirtualRobot) -> Iterator[Counter[Phase]]:
    """Count, in another thread, what the board's process is busy with."""
    counts: Counter[Phase] = Counter()
    done = threading.Event()

    def sample() -> None:
        while not done.wait(SAMPLE_S):
            counts[robot.phase()] += 1

    thread = threading.Thread(target=sample)
    thread.start()
    try:
        yield counts
    finally:
        done.set()
        thread.join()


def _shares(counts: Counter[Phase], decoding: float) -> dict[str, float]:
    """Shares of the time; `decoding`, which code takes the first time, is taken out of that of the code."""
    total = counts.total() or 1
    shares = {NAMES[phase]: counts[phase] / total for phase in Phase}
    code = shares.pop(NAMES[Phase.CODE])
    first = min(decoding, code)
    return {"decoding": first, "code": code - first, **shares}


def _print_shares(demo: Drive, full: Drive) -> None:
    console = Console(stderr=True)
    for name, one in ((PLAN, demo), ("link saturated", full)):
        parts = ", ".join(f"{part} {100 * share:.0f} %" for part, share in one.shares.items())
        console.print(f"where the time goes, {name}: {parts}", highlight=False)


def _frame(request: LogReadRequest | StatusRequest, sequence: int) -> bytes:
    return encode(Frame(request.ID, sequence, request.pack()))


def _broken_frame() -> bytes:
    """A frame that the board reads to its end and then throws away."""
    whole = bytearray(encode(Frame(StatusRequest.ID, 0, bytes(range(1, 101)))))
    whole[50] ^= 1
    return bytes(whole)


def _demo(image: Path) -> Drive:
    """From power-on to the sequence's end; then the same drive with all code decoded."""
    plan = load_plan(PLAN)
    began = time.process_time()
    with VirtualRobot(image) as robot, Device(Client(VirtualStream(robot))) as device:
        drive(device, plan)
        first_s, virtual_s = time.process_time() - began, robot.time_s
        began = time.process_time()
        drive(device, plan)
        again_s = (time.process_time() - began) * virtual_s / (robot.time_s - virtual_s)
    with (
        VirtualRobot(image) as robot,
        _sampled(robot) as counts,
        Device(Client(VirtualStream(robot))) as device,
    ):
        drive(device, plan)
    return Drive(virtual_s / first_s, _shares(counts, max(0.0, 1 - again_s / first_s)))


def _best(drive_once: Callable[[], Drive]) -> Drive:
    return max((drive_once() for _ in range(ROUNDS)), key=lambda one: one.speed)


def _drive_saturated(image: Path, reads_under_way: int, filler: bytes, sample: bool = False) -> Drive:
    """Drive the plan while log reads keep one lane full and `filler` the rest of the other."""
    with VirtualRobot(image) as robot, Device(Client(VirtualStream(robot))) as device:
        plan = load_plan(PLAN)
        drive(device, plan)  # leaves a log to read while the plan runs again
        log = device.log()
        device.start(device.upload(plan), unattended=True)

        read = LogReadRequest(offset=log.offset, length=min(1000, log.length))
        decoder = FrameDecoder()
        asked = answered = written = 0
        began, began_s = time.process_time(), robot.time_s
        with _sampled(robot) if sample else nullcontext(Counter[Phase]()) as counts:
            while robot.time_s - began_s < plan.duration_s:
                while asked - answered < reads_under_way:
                    asked += 1
                    written += _send(robot, _frame(read, asked & 0xFFFF))
                while robot.link_pending() < 2 * SLICE_US * 1e-6 * LINE_BYTES_PER_S:
                    written += _send(robot, filler)
                robot.run_us(SLICE_US)
                answered += sum(frame.id == read.ID | REPLY_BIT for frame in decoder.feed(robot.link_read()))
        span_s = robot.time_s - began_s
        speed = span_s / (time.process_time() - began)
        received = (written - robot.link_pending()) / span_s
        return Drive(speed, _shares(counts, 0.0), received, decoder.counts.bytes / span_s)


def _send(robot: VirtualRobot, data: bytes) -> int:
    robot.link_write(data)
    return len(data)
