"""Plain MCAP files: channels of JSON messages, through a mapping file whose columns are `TOPIC.FIELD`.

`TOPIC.log_time` and `TOPIC.publish_time` are the file's own stamps, in seconds since its first message.
The topic that `t_s` comes from gives the rows; a number from another topic is the last one that was logged
by then. A file of truing's own (`truing export --to mcap`, or what Foxglove recorded of `truing stream`)
needs no mapping: its topic `/signals` names its fields as a run's columns.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import CutOffError, RecordingError
from truing.extras import require
from truing.recording.run import COMMAND_PAIR, NUMERIC_COLUMNS, REQUIRED_COLUMNS

from .foreign import Finding, ForeignTest, ImportOptions
from .mapped_csv import find_mapping, has_mapping
from .mapping import Mapping, Source, apply

KIND = "MCAP with JSON messages"
MAGIC = b"\x89MCAP0\r\n"
JSON = "json"
# The topic of truing's own files.
OWN_TOPIC = "/signals"


@dataclass(slots=True)
class Channel:
    """Messages of one topic: log times (s) and a number or None per field and message."""

    times: list[float] = field(default_factory=list)
    rows: list[dict[str, float]] = field(default_factory=list)

    def sort(self) -> None:
        """Put the messages in the order of their log times; a file may hold them in another."""
        order = sorted(range(len(self.times)), key=self.times.__getitem__)
        self.times = [self.times[k] for k in order]
        self.rows = [self.rows[k] for k in order]

    def column(self, name: str) -> list[float]:
        """The field's numbers; NaN where a message does not have it."""
        return [row.get(name, np.nan) for row in self.rows]


def matches(path: Path, head: bytes) -> bool:
    """Whether the file is MCAP and its first message is JSON: those of ROS have its own encoding."""
    if not head.startswith(MAGIC):
        return False
    try:
        _, encoding, _, _ = next(_messages(path))
    except (RecordingError, StopIteration):
        return JSON.encode() in head
    return encoding == JSON


def read(path: Path, options: ImportOptions) -> tuple[list[ForeignTest], list[Finding]]:
    """The messages of the mapping's topics as one test, or as several where the mapping splits."""
    channels, texts, findings = _channels(path)
    own = None if has_mapping(path, options) else _own_mapping(path, channels)
    mapping = own or find_mapping(path, options)
    return apply(mapping, _table(path, mapping, channels, texts), path), findings


def columns_of(path: Path) -> dict[str, tuple[float, float]]:
    """Every column that a mapping can take, with the ends of its range; none where truing wrote the file.

    Raises
    ------
    RecordingError : the file holds no whole JSON message.
    """
    channels, _, _ = _channels(path)
    if _own_mapping(path, channels) is not None:
        return {}
    found = {}
    for topic, channel in channels.items():
        for name in channel.rows[0]:
            values = [value for value in channel.column(name) if value == value]
            found[f"{topic}.{name}"] = (min(values), max(values))
    return found


def _channels(
    path: Path,
) -> tuple[dict[str, Channel], dict[str, list[tuple[float, str]]], list[Finding]]:
    """Numbers by topic, texts by column, and what is to be said of the file."""
    channels: dict[str, Channel] = {}
    texts: dict[str, list[tuple[float, str]]] = {}
    try:
        for topic, encoding, (logged, published), data in _messages(path):
            if encoding == JSON:
                _add(path, channels.setdefault(topic, Channel()), texts, topic, (logged, published), data)
    except CutOffError as stop:
        text = f"the file ends early or is damaged ({stop.problem}); read up to there"
        findings = [Finding("cut_off", text)]
    else:
        findings = []
    if not channels:
        raise RecordingError(path, "holds no whole JSON message")
    for channel in channels.values():
        channel.sort()
    return channels, texts, findings


def _own_mapping(path: Path, channels: dict[str, Channel]) -> Mapping | None:
    """The columns of truing's own topic under their own names, or None where there is none.

    Commands stay behind: their unit is a row's mode, and an imported run has none.
    """
    if OWN_TOPIC not in channels:
        return None
    names = {name for row in channels[OWN_TOPIC].rows for name in row}
    taken = names & NUMERIC_COLUMNS - set(COMMAND_PAIR)
    if not taken.issuperset(REQUIRED_COLUMNS):
        return None
    return Mapping(path, {name: Source(f"{OWN_TOPIC}.{name}", scaled=True) for name in sorted(taken)})


def _messages(path: Path) -> Iterator[tuple[str, str, tuple[float, float], bytes]]:
    """(topic, encoding, (log, publish) times in seconds, payload) in the file's order."""
    require("bags")
    from mcap.reader import NonSeekingReader

    # A double holds nanoseconds since a file's beginning, but not since 1970.
    origin: int | None = None
    try:
        with path.open("rb") as stream:
            # A damaged length must not ask for more memory than the file can fill.
            reader = NonSeekingReader(stream, record_size_limit=path.stat().st_size)
            for _, channel, message in reader.iter_messages(log_time_order=False):
                origin = message.log_time if origin is None else origin
                times = (1e-9 * (message.log_time - origin), 1e-9 * (message.publish_time - origin))
                yield channel.topic, channel.message_encoding, times, message.data
    except OSError as error:
        raise RecordingError(path, f"cannot be read: {error.strerror}") from None
    except Exception as error:
        # What a damaged file breaks in the reader has no common type.
        raise CutOffError(path, str(error) or type(error).__name__) from None


def _add(
    path: Path,
    channel: Channel,
    texts: dict[str, list[tuple[float, str]]],
    topic: str,
    times: tuple[float, float],
    data: bytes,
) -> None:
    try:
        message = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise RecordingError(path, f"a message of {topic} at {times[0]:.6f} s is no JSON: {error}") from None
    row = {"log_time": times[0], "publish_time": times[1]}
    for name, value in _leaves(message, ""):
        if isinstance(value, str):
            texts.setdefault(f"{topic}.{name}", []).append((times[0], value))
        else:
            row[name] = float(value)
    channel.times.append(times[0])
    channel.rows.append(row)


def _leaves(value: Any, name: str) -> Iterator[tuple[str, float | str]]:
    """Numbers and texts with the dotted names of where they stand."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _leaves(part, f"{name}.{key}" if name else str(key))
    elif isinstance(value, list):
        for index, part in enumerate(value):
            yield from _leaves(part, f"{name}.{index}" if name else str(index))
    elif isinstance(value, (bool, int, float, str)):
        yield name or "value", value


def _table(
    path: Path, mapping: Mapping, channels: dict[str, Channel], texts: dict[str, list[tuple[float, str]]]
) -> dict[str, list[Any]]:
    """The mapped columns on the rows of the topic that gives the time."""
    wanted = {source.column for source in mapping.columns.values()}
    base = _topic_of(path, mapping.columns["t_s"].column, channels)
    times = np.array(channels[base].times)
    table: dict[str, list[Any]] = {}
    for column in sorted(wanted):
        topic = _topic_of(path, column, channels)
        values = channels[topic].column(column[len(topic) + 1 :])
        if all(value != value for value in values):
            continue  # `apply` names it, with what there is
        table[column] = values if topic == base else _held(np.array(channels[topic].times), values, times)
    if mapping.split is not None and mapping.split in texts:
        labels = sorted(texts[mapping.split], key=lambda item: item[0])
        index = np.searchsorted([time for time, _ in labels], times, side="right") - 1
        table[mapping.split] = [labels[i][1] if i >= 0 else "" for i in index]
    return table if wanted <= table.keys() else table | _every(channels)


def _topic_of(path: Path, column: str, channels: dict[str, Channel]) -> str:
    """The longest topic that the column's name begins with."""
    fitting = [topic for topic in channels if column.startswith(f"{topic}.")]
    if not fitting:
        known = ", ".join(_every(channels))
        raise RecordingError(path, f"no topic of this name; columns: {known}", column=column)
    return max(fitting, key=len)


def _every(channels: dict[str, Channel]) -> dict[str, list[Any]]:
    """All column names, for errors."""
    return {f"{topic}.{name}": [] for topic, channel in channels.items() for name in channel.rows[0]}


def _held(stamps: FloatArray, values: list[float], times: FloatArray) -> list[float]:
    """The last value by each time; the first one before it was logged."""
    index = np.clip(np.searchsorted(stamps, times, side="right") - 1, 0, len(values) - 1)
    held: list[float] = np.array(values)[index].tolist()
    return held
