"""Writes the seeds of the fuzz programs from the protocol's test vectors: ``seeds.py FOLDER``."""

import json
import struct
import sys
from pathlib import Path

VECTORS = Path(__file__).parents[2] / "protocol" / "vectors" / "vectors.json"
ASK, TICKS, COUNTS, BATTERY, ASK_WITH_CRC, OVERRUN = 0, 1, 2, 3, 5, 6
SEQ_BEGIN, SEQ_SEGMENTS, SEQ_COMMIT, SEQ_START = 0x20, 0x21, 0x22, 0x23
REPLY_BIT = 0x80
LOG_ARM = 0x34
STORE_FORMAT = 0x00080001  # firmware/README.md, parameter store


def ask(request_id: int, payload: bytes) -> bytes:
    """One step of fuzz_requests."""
    return bytes([ASK, request_id, min(len(payload), 255)]) + payload[:255]


def segment(duration_ms: int, kind: int, a: float, b: float) -> bytes:
    """One packed segment (protocol/SPEC.md)."""
    return struct.pack("<IBff", duration_ms, kind, a, b)


def frame_seeds(vectors: dict[str, list[dict[str, str]]]) -> list[bytes]:
    stuffed = [bytes.fromhex(vector["stuffed"]) + b"\0" for vector in vectors["cobs"]]
    return stuffed + [bytes.fromhex(message["frame"]) for message in vectors["messages"]]


def request_seeds(messages: list[dict[str, str]]) -> list[bytes]:
    seeds = [
        ask(int(message["id"]), bytes.fromhex(message["payload"])) + bytes([TICKS, 20])
        for message in messages
        if int(message["id"]) < REPLY_BIT
    ]
    packed = segment(40, 0, 0.5, 0.5) + segment(40, 1, 0.3, -0.3)
    upload = ask(SEQ_BEGIN, struct.pack("<HH", 2, 100)) + ask(SEQ_SEGMENTS, b"\0\0" + packed)
    run = bytes([ASK_WITH_CRC, SEQ_COMMIT, ASK_WITH_CRC, SEQ_START, TICKS, 120])
    seeds.append(upload + run)
    seeds.append(ask(0x40, struct.pack("<ff", 0.4, -0.4)) + bytes([TICKS, 50]) + ask(0x42, b""))
    seeds.append(ask(0x41, struct.pack("<ff", 0.4, 0.2)) + bytes([TICKS, 200]))
    # Every reason why a request to move is refused by a robot that stands, and by one that moves.
    effort, run_held = ask(0x40, struct.pack("<ff", 0.4, -0.4)), bytes([ASK_WITH_CRC, SEQ_START])
    unread, flat = bytes([BATTERY, 0xFF, 0xFF]), bytes([BATTERY]) + struct.pack("<H", 2000)
    pushed, overrun = bytes([COUNTS]) + struct.pack("<hh", 900, -900), bytes([OVERRUN])
    seeds += [
        before + trouble + bytes([TICKS, 140]) + effort + run_held + bytes([TICKS, 2])
        for trouble in (unread, flat, pushed, overrun)
        for before in (b"", effort, upload + run)
    ]
    seeds.append(upload + run[:4] + bytes([TICKS, 5]) + effort + bytes([TICKS, 2]))
    # A log that is armed, for a fault and for a count, and what comes of it; disarmed before and after.
    disarm, ticks = ask(LOG_ARM, struct.pack("<BBBiII", 0, 0, 0, 0, 0, 0)), bytes([TICKS, 200])
    for wish in ((2, 0, 0, 0, 300, 100), (1, 6, 0, 50, 200, 100), (1, 6, 1, -50, 0, 0)):
        arm = ask(LOG_ARM, struct.pack("<BBBiII", *wish))
        seeds.append(arm + effort + ticks + pushed + ticks + disarm + ticks)
        seeds.append(arm + disarm + arm + ticks + run_held + effort + ticks + ticks + arm + ask(0x35, b""))
    return seeds


def sequence_seeds() -> list[bytes]:
    seeds = []
    for kind in range(3):
        packed = segment(30, kind, 0.3, 0.2) + segment(20, kind, -0.3, 0.0)
        seeds.append(struct.pack("<HHHB", 2, 50, 0, 2) + packed)
    halves = segment(10, 0, 0.2, 0.2), segment(10, 1, 0.2, 0.2)
    seeds.append(struct.pack("<HHHB", 2, 0, 0, 1) + halves[0] + struct.pack("<HB", 1, 1) + halves[1])
    return seeds


def parameter_seeds() -> list[bytes]:
    settings = b"".join(struct.pack("<Hf", index, 1.0) for index in range(16))
    seeds = [bytes([flags, 0, 0]) + settings for flags in (0, 3, 4, 0xFC)]
    # A header whose number of records says that the set is longer than the slot, by a little and by a lot.
    for records in (2043, 2045, 1 << 20, 0xFFFFFFFF):
        header = struct.pack("<BIII", 3, STORE_FORMAT, 1, records)
        seeds.append(bytes([3]) + header + bytes([0]) + settings)
    return seeds


def log_seeds(log: dict[str, list[list[int]]]) -> list[bytes]:
    records = [[value & 0xFFFFFFFF for value in record] for record in log["records"]]
    words = b"".join(struct.pack("<16I", *record) for record in records)
    reads = b"".join(
        struct.pack("<BII", kind, offset, length)
        for kind in range(3)
        for offset, length in ((0, 512), (500, 100), (511, 1), (512, 512))
    )
    return [bytes([len(records) - 1]) + words + reads]


def main() -> None:
    vectors = json.loads(VECTORS.read_text())
    seeds = {
        "frame": frame_seeds(vectors),
        "requests": request_seeds(vectors["messages"]),
        "sequence": sequence_seeds(),
        "parameters": parameter_seeds(),
        "log": log_seeds(vectors["log"]),
    }
    for subject, inputs in seeds.items():
        folder = Path(sys.argv[1]) / subject
        folder.mkdir(parents=True, exist_ok=True)
        for number, content in enumerate(inputs):
            (folder / f"seed-{number}").write_bytes(content)


if __name__ == "__main__":
    main()
