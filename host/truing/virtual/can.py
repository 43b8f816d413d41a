"""Virtual boards on a CAN bus inside this process: `can:sim`, and python-can's virtual bus."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

from truing.errors import LinkClosed, PortError
from truing.link.can_bus import AdapterBus
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing.virtual.board import make_virtual_robot
from truing.virtual.options import VirtualOptions
from truing_protocol import PARAMETERS, ParamSetRequest

if TYPE_CHECKING:
    import can

    from hil_sim import VirtualCanBus, VirtualRobot
    from hil_sim.can_bus import CanNode

MAX_BOARDS = 16
_START_US = 20_000  # until a virtual board answers, and until it has joined its bus
_STEP_US = 100  # about one frame at 1 Mbit/s; a finer step hears nothing sooner
_SLEEP_STEP_US = 20_000


def make_bus_of_boards(options: VirtualOptions, nodes: Iterable[int], bit_rate: int) -> VirtualCanBus:
    """Switch boards on, give each its node and the bit rate over its serial line, and join them.

    Each differs from the others in its seed and in its chip's id.

    Raises
    ------
    VirtualBoardError : the boards cannot start.
    """
    from hil_sim import VirtualCanBus

    robots: list[VirtualRobot] = []
    try:
        for node in nodes:
            robots.append(make_virtual_robot(replace(options, seed=options.seed + len(robots)), node))
            robots[-1].run_us(_START_US)
            client = Client(VirtualStream(robots[-1]))
            _set(client, "can_node", node)
            _set(client, "can_bitrate_kbps", bit_rate / 1000)
    except BaseException:
        _switch_off(robots)
        raise
    bus = VirtualCanBus(bit_rate)
    latest = max(robot.time_us for robot in robots)
    for robot in robots:
        robot.run_us(latest - robot.time_us)  # the boards of a bus have one time
        bus.attach(robot)
    bus.run_us(_START_US)
    return bus


def _set(client: Client, name: str, value: float) -> None:
    index = next(each.index for each in PARAMETERS if each.name == name)
    client.request(ParamSetRequest(index, value))


def free(bus: VirtualCanBus) -> None:
    """Take a bus apart and switch its boards off."""
    robots = tuple(bus.robots)
    bus.close()
    _switch_off(robots)


def _switch_off(robots: Iterable[CanNode]) -> None:
    for robot in robots:
        robot.close()


class SimulatedBus:
    """The host's node on a bus of virtual boards: waiting makes their time pass.

    Parameters
    ----------
    on_close : called once when the bus is closed; whoever made the boards for it frees them here.
    """

    virtual = True

    name = "can:sim"

    def __init__(self, bus: VirtualCanBus, on_close: Callable[[], None] | None = None) -> None:
        self._bus = bus
        self._on_close = on_close

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame; it takes part in arbitration as time passes."""
        from hil_sim import CanFrame

        if not self._bus.write(CanFrame(can_id, data)):
            raise LinkClosed(f"{self.name}: the bus takes no more frames")

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """Return the next frame, letting up to `timeout_s` pass."""
        # Upwards: a wait of less than a microsecond must pass too, or its end is never seen.
        left = max(0, math.ceil(timeout_s * 1e6))
        while (frame := self._bus.read()) is None:
            if left <= 0:
                return None
            step = min(left, _STEP_US)
            self._bus.run_us(step)
            left -= step
        return frame.id, frame.data

    def sleep(self, seconds: float) -> None:
        """Let virtual time pass."""
        left = round(seconds * 1e6)
        while left > 0:
            self._bus.run_us(min(left, _SLEEP_STEP_US))
            left -= _SLEEP_STEP_US

    def now_s(self) -> float:
        """Return the virtual time."""
        return self._bus.time_s

    def close(self) -> None:
        """Leave the bus; closing twice is harmless."""
        if self._on_close is not None:
            on_close, self._on_close = self._on_close, None
            on_close()


class Channel:
    """A channel of python-can's virtual bus with virtual boards on it, as one node of theirs.

    It lasts from the first of its hosts to the last: all that open it in this process share its boards.
    """

    _channels: ClassVar[dict[str, Channel]] = {}

    def __init__(self, name: str, bus: VirtualCanBus) -> None:
        import can

        self.name = name
        self.bus = bus
        self._node: can.BusABC = can.Bus(interface="virtual", channel=name)
        self._held: can.Message | None = None
        self._hosts = 0

    @classmethod
    def join(cls, name: str, make: Callable[[], VirtualCanBus]) -> Channel:
        """Return the channel of that name; `make` makes its boards when there is none."""
        channel = cls._channels.get(name)
        if channel is None:
            channel = cls._channels[name] = cls(name, make())
        channel._hosts += 1
        return channel

    def leave(self) -> None:
        """One host leaves; the last one switches the boards off."""
        self._hosts -= 1
        if self._hosts == 0:
            del self._channels[self.name]
            self._node.shutdown()
            free(self.bus)

    def run_us(self, span_us: int) -> None:
        """Pass frames on, let time pass, and pass on what the boards have said."""
        self._pass_to_boards()
        self.bus.run_us(span_us)
        self._pass_to_hosts()

    def _pass_to_boards(self) -> None:
        from hil_sim import CanFrame

        while (message := self._held or self._node.recv(0.0)) is not None:
            remote = message.is_remote_frame
            data = b"" if remote else bytes(message.data)
            frame = CanFrame(message.arbitration_id, data, message.is_extended_id, remote)
            if message.is_fd or message.is_error_frame:
                continue  # the boards' controller is one of classic CAN
            self._held = None if self.bus.write(frame) else message
            if self._held is not None:
                return  # the bus is full; this one waits its turn

    def _pass_to_hosts(self) -> None:
        import can

        while (frame := self.bus.read()) is not None:
            self._node.send(
                can.Message(
                    arbitration_id=frame.id,
                    data=frame.data,
                    is_extended_id=frame.extended,
                    is_remote_frame=frame.remote,
                )
            )


class ChannelBus(AdapterBus):
    """A host on a `Channel`, through python-can: waiting makes the boards' time pass."""

    virtual = True

    def __init__(self, channel: Channel, bit_rate: int) -> None:
        self._channel: Channel | None = channel
        super().__init__("virtual", channel.name, bit_rate)

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """Return the next frame, letting up to `timeout_s` pass."""
        left = max(0, math.ceil(timeout_s * 1e6))
        while (frame := super().receive(0.0)) is None:
            if left <= 0:
                return None
            left -= self._pass(min(left, _STEP_US))
        return frame

    def sleep(self, seconds: float) -> None:
        """Let virtual time pass."""
        left = round(seconds * 1e6)
        while left > 0:
            left -= self._pass(min(left, _SLEEP_STEP_US))

    def now_s(self) -> float:
        """Return the virtual time."""
        return self._there().bus.time_s

    def close(self) -> None:
        """Leave the bus; closing twice is harmless."""
        super().close()
        if self._channel is not None:
            channel, self._channel = self._channel, None
            channel.leave()

    def _pass(self, us: int) -> int:
        self._there().run_us(us)
        return us

    def _there(self) -> Channel:
        if self._channel is None:
            raise LinkClosed(f"{self.name}: the link is closed")
        return self._channel


def open_simulated(options: VirtualOptions, node: int, bit_rate: int) -> SimulatedBus:
    """A bus with one virtual board, of the node that is asked for."""
    bus = make_bus_of_boards(options, [node], bit_rate)
    return SimulatedBus(bus, on_close=lambda: free(bus))


def open_channel(options: VirtualOptions, where: str, node: int, bit_rate: int) -> AdapterBus:
    """A host on python-can's virtual bus; `where` is `CHANNEL[,BOARDS]`, or empty.

    A channel that somebody else in this process is on already is joined as it is, in real time.

    Raises
    ------
    PortError : the number of boards is none, or the node is not among them.
    """
    from can.interfaces import virtual

    name, comma, number = where.partition(",")
    name = name or "truing"
    boards = int(number) if number.isdecimal() else 0 if comma else 1
    if not 1 <= boards <= MAX_BOARDS:
        raise PortError(
            f"can:virtual:{where}: not a number of virtual boards",
            f"write can:virtual:CHANNEL,BOARDS with 1 to {MAX_BOARDS} boards, "
            "for example can:virtual:robots,3/2",
        )
    if name in virtual.channels and name not in Channel._channels:
        return AdapterBus("virtual", name, bit_rate)
    channel = Channel.join(name, lambda: make_bus_of_boards(options, range(1, boards + 1), bit_rate))
    there = len(channel.bus.robots)
    if node > there:
        channel.leave()
        raise PortError(
            f"can:virtual:{where}/{node}: the bus has {there} virtual board{'s' if there > 1 else ''}",
            f"choose a node from 1 to {there}, or more boards: can:virtual:{name},{node}/{node}",
        )
    return ChannelBus(channel, bit_rate)
