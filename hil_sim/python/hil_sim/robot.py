"""One virtual robot: a board that runs the flashed image, wired to a simulated robot, in virtual time."""

from __future__ import annotations

import ctypes
import enum
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hil_sim import native
from hil_sim.can_bus import VirtualCanBus
from hil_sim.elf import Image
from hil_sim.oscillators import Oscillators
from hil_sim.plant import PlantState, RobotParameters, params_of
from hil_sim.simulated import Simulated
from hil_sim.unmodelled_effects import UnmodelledEffects

if TYPE_CHECKING:
    from hil_sim.recorded import Samples

DEFAULT_BOARD_ID = bytes.fromhex("3930325547310a0000000001")
"""Unique id of a virtual board unless another is given."""

_CONSTANTS = native.HEADERS.constants

EXCEPTIONS = _CONSTANTS["BOARD_EXCEPTIONS"]
"""Exception numbers of the STM32F405: 16 of the CPU and 82 of the chip."""

_BUFFER_SIZE = 4096
_MAX_PPM = 500.0
_FLASH = range(0x08000000, 0x08100000)

FACTORY_OPTION_BYTES = 0x0FFFAAEC
"""Option bytes of a new chip: the brown-out reset is off."""

OPTION_BYTES = 0x0FFFAAE0
"""Those that `truing flash` leaves: brown-out reset at level 3."""


class VirtualRobotError(RuntimeError):
    """A virtual robot that cannot be made, or a request that it cannot fulfil."""


class ResetCause(enum.IntEnum):
    """Ways to reset a board."""

    POWER = _CONSTANTS["BOARD_RESET_POWER"]
    BROWNOUT = _CONSTANTS["BOARD_RESET_BROWNOUT"]
    PIN = _CONSTANTS["BOARD_RESET_PIN"]
    SOFTWARE = _CONSTANTS["BOARD_RESET_SOFTWARE"]
    WATCHDOG = _CONSTANTS["BOARD_RESET_WATCHDOG"]


class Target(enum.IntEnum):
    """Boards that a chip is soldered on: other pins, motor drivers, crystal, divider (`rig/pin_map.c`)."""

    OLIMEX_H405 = _CONSTANTS["RIG_TARGET_OLIMEX_H405"]
    F405_USB = _CONSTANTS["RIG_TARGET_F405_USB"]
    PWM_DIR = _CONSTANTS["RIG_TARGET_PWM_DIR"]
    PHASE_ENABLE = _CONSTANTS["RIG_TARGET_PHASE_ENABLE"]


_TARGETS = {
    "truing-f405": Target.OLIMEX_H405,
    "truing-f405-usb": Target.F405_USB,
    "truing-f405-pwm": Target.PWM_DIR,
    "truing-f405-phase": Target.PHASE_ENABLE,
}
# Images for chips that there is no virtual board of.
_NO_BOARD = {"truing-g474": "STM32G474"}


class EncoderFault(enum.IntEnum):
    """Faults of an encoder's plug or disc."""

    GOOD = _CONSTANTS["RIG_ENCODER_GOOD"]
    UNPLUGGED = _CONSTANTS["RIG_ENCODER_UNPLUGGED"]
    FROZEN = _CONSTANTS["RIG_ENCODER_FROZEN"]
    REVERSED = _CONSTANTS["RIG_ENCODER_REVERSED"]
    PHASE_A_DROPPED = _CONSTANTS["RIG_ENCODER_PHASE_A"]
    PHASE_B_DROPPED = _CONSTANTS["RIG_ENCODER_PHASE_B"]


@native.mirror("rig_encoder_noise")
@dataclass(frozen=True)
class EncoderNoise:
    """What the wires of an encoder pick up, and how slowly its lines rise; all zero: nothing.

    Attributes
    ----------
    period_us, first_us, burst_us : bursts of pulses come this often, the first at this virtual time, and
        last so long.
    pulse_ns : pulses of this width and as much between them, in turn on phase A and phase B.
    rise_ns : a line takes this long to rise through its input's threshold...
    bounce_ns : ...and wavers there with pulses of this width; 0: it rises once, at the end.
    """

    period_us: int = 0
    first_us: int = 0
    burst_us: int = 0
    pulse_ns: int = 0
    rise_ns: int = 0
    bounce_ns: int = 0


class Phase(enum.IntEnum):
    """What a virtual board's process is busy with."""

    OUTSIDE = _CONSTANTS["BOARD_OUTSIDE"]
    CODE = _CONSTANTS["BOARD_CODE"]
    INTERRUPTS = _CONSTANTS["BOARD_INTERRUPTS"]
    PERIPHERALS = _CONSTANTS["BOARD_PERIPHERALS"]
    PLANT = _CONSTANTS["BOARD_PLANT"]


@native.mirror("board_cost")
@dataclass(frozen=True)
class ExceptionCost:
    """Cost of one exception number so far, without nested exceptions."""

    activations: int
    instructions: int
    worst_instructions: int
    cycles: int
    worst_cycles: int


@native.mirror("board_stats")
@dataclass(frozen=True)
class BoardStats:
    """Totals of a board since its creation."""

    cycles: int
    sleep_cycles: int
    instructions: int
    interrupts: int
    tail_chains: int
    registers: int
    resets: int
    cpu_hz: int
    locked_up: bool
    powered: bool


@dataclass(frozen=True)
class BoardWarning:
    """A warning of the board: a register not modelled, a peripheral without its clock, and the like."""

    text: str
    hits: int


class VirtualRobot(Simulated):
    """A board with an image in flash, switched on, and the robot it drives.

    Parameters
    ----------
    image : ELF file, the one that is flashed.
    robot : its numbers; the paper's robot when left out.
    seed : decides noise, SRAM content at power-on and random numbers; the same seed gives the same run.
    board_id : the chip's 12-byte unique id.
    crystal : whether the crystal starts.
    crystal_ppm : how much faster than the nominal 8 MHz (or 12) it is, in whole hertz; within 500 either way.
    oscillators : all three frequencies, instead of `crystal_ppm`; nominal when left out.
    option_bytes : FLASH_OPTCR as the chip loads it, without its lock.
    connected : False leaves the board alone on the bench: no motors, encoders or battery.
    target : the board; the one that the image is named for, or the first where it has no name, when left out.
    library : another build of the native library.

    Attributes
    ----------
    target : the board.
    can_bus : the CAN bus that the board is plugged into (`VirtualCanBus.attach`), or None.

    Raises
    ------
    ElfError : the image cannot be used.
    VirtualRobotError : the robot's parameters are bad, or the image does not fit into flash.
    OSError : the native library is not built.
    """

    def __init__(
        self,
        image: Path,
        robot: RobotParameters | None = None,
        seed: int = 1,
        board_id: bytes = DEFAULT_BOARD_ID,
        *,
        crystal: bool = True,
        crystal_ppm: float = 0.0,
        oscillators: Oscillators | None = None,
        connected: bool = True,
        option_bytes: int = OPTION_BYTES,
        target: Target | None = None,
        library: Path | None = None,
    ) -> None:
        self._rig: int | None = None
        self.can_bus: VirtualCanBus | None = None
        if len(board_id) != 12:
            raise VirtualRobotError(f"a board id has 12 bytes, not {len(board_id)}")
        oscillators = oscillators or Oscillators(crystal_ppm)
        _check_ppm(oscillators.crystal_ppm)
        self._buffer = ctypes.create_string_buffer(_BUFFER_SIZE)
        self._library = native.load(library) if library else native.load()
        self.image = Image.load(Path(image))
        if self.image.name in _NO_BOARD:
            chip = _NO_BOARD[self.image.name]
            raise VirtualRobotError(f"{image} is for an {chip}, of which there is no virtual board")
        self.robot = robot or RobotParameters.msrp(library)
        problem = self.robot.problem(library) if connected else None
        if problem is not None:
            raise VirtualRobotError(problem)
        parameters = ctypes.byref(params_of(self.robot)) if connected else None
        if target is None:
            target = _TARGETS.get(self.image.name, Target.OLIMEX_H405)
        self.target = target
        self._rig = self._library.rig_create(parameters, seed & (2**64 - 1), board_id, crystal, target)
        if self._rig is None:
            raise VirtualRobotError("the CPU engine of the virtual board does not start")
        self._board: int = self._library.rig_board(self._rig)
        for address, content in self.image.segments:
            fits = address in _FLASH
            if not (fits and self._library.rig_flash(self._rig, address, content, len(content))):
                raise VirtualRobotError(f"{image} wants to be loaded to 0x{address:08X}, which is not flash")
        self._library.rig_crystal_ppm(self._rig, oscillators.crystal_ppm)
        self._library.board_set_hsi_hz(self._board, oscillators.hsi_hz)
        self._library.board_set_lsi_hz(self._board, oscillators.lsi_hz)
        self._library.board_set_option_bytes(self._board, option_bytes)
        self._library.rig_power(self._rig, True)

    def close(self) -> None:
        """Free the board; nothing may be called afterwards."""
        if self._rig is not None:
            if self.can_bus is not None:
                self.can_bus.detach(self)
            self._library.rig_destroy(self._rig)
            self._rig = None

    # time

    @property
    def time_us(self) -> int:
        """Virtual time since creation, microseconds."""
        return int(self._library.rig_time_us(self._rig))

    def run_us(self, n: int) -> None:
        """Advance virtual time by `n` microseconds; the result does not depend on how a span is split.

        On a CAN bus the time of all its boards advances.
        """
        if self.can_bus is not None:
            self.can_bus.run_us(n)
            return
        self._library.rig_run_us(self._rig, n)

    @property
    def rig_handle(self) -> int | None:
        """Board and wiring in the native library, for a CAN bus."""
        return self._rig

    # the link (USART3)

    def link_write(self, data: bytes) -> None:
        """Send bytes to the board; they enter its receiver from now on, one after the other."""
        self._library.rig_link_write(self._rig, bytes(data), len(data))

    def link_read(self) -> bytes:
        """Return the bytes that the board has completely shifted out by now and that were not yet read."""
        received = b""
        while (n := int(self._library.rig_link_read(self._rig, self._buffer, _BUFFER_SIZE))) > 0:
            received += ctypes.string_at(self._buffer, n)
        return received

    def phase(self) -> Phase:
        """Return what the board is busy with, for a profiler in another thread; `OUTSIDE` between calls."""
        return Phase(self._library.rig_phase(self._rig))

    def link_pending(self) -> int:
        """Return how many bytes to the board are still on the line."""
        return int(self._library.rig_link_pending(self._rig))

    def set_link_baud(self, baud: float) -> None:
        """Set the speed of the host's port, 921600 at first; 0 cuts the cable."""
        self._library.rig_link_baud(self._rig, baud)

    def set_link_noise(self, period_ns: int, pulse_ns: int) -> None:
        """Turn the line to the board over for `pulse_ns` each `period_ns`; 0: never.

        A pulse disturbs bytes; between two bytes it does nothing.
        """
        self._library.rig_link_noise(self._rig, period_ns, pulse_ns)

    # access as a debugger has it

    def symbol(self, name: str) -> tuple[int, int]:
        """Return address and size of a symbol of the image."""
        try:
            return self.image.symbols[name]
        except KeyError:
            raise VirtualRobotError(f"the image has no symbol {name}") from None

    def read_memory(self, addr: int, n: int) -> bytes:
        """Return `n` bytes of flash, SRAM, CCM or system memory."""
        buffer = ctypes.create_string_buffer(n)
        if not self._library.board_read_memory(self._board, addr, buffer, n):
            raise VirtualRobotError(f"there is no memory of {n} bytes at 0x{addr:08X}")
        return buffer.raw

    def write_memory(self, addr: int, data: bytes) -> None:
        """Write bytes into SRAM or CCM."""
        if not self._library.board_write_memory(self._board, addr, bytes(data), len(data)):
            raise VirtualRobotError(f"there is no SRAM of {len(data)} bytes at 0x{addr:08X}")

    def set_stack_pointer(self, address: int) -> None:
        """Set the CPU's stack pointer, between two stretches of code."""
        self._library.board_set_stack_pointer(self._board, address)

    def trace_hash(self) -> str:
        """Return the hash over everything that has happened at the pins, 32 hexadecimal digits."""
        lanes = (ctypes.c_uint64 * 2)()
        self._library.board_trace_hash(self._board, lanes)
        return f"{lanes[0]:016x}{lanes[1]:016x}"

    def trace_count(self) -> int:
        """Return how many events the trace hash covers."""
        return int(self._library.board_trace_count(self._board))

    def next_tick_us(self) -> float:
        """Return when SysTick next reaches zero, microseconds of virtual time."""
        return float(self._library.board_next_tick_ps(self._board)) * 1e-6

    def cost(self, exception: int) -> ExceptionCost:
        """Return the cost of an exception number: 0 thread mode, 15 SysTick, 16 + n interrupt n."""
        cost = native.new(ExceptionCost)
        self._library.board_cost(self._board, exception, ctypes.byref(cost))
        return native.from_struct(ExceptionCost, cost)

    def costs(self) -> dict[int, ExceptionCost]:
        """Return the cost of thread mode and of every exception number that was ever active."""
        costs = {n: self.cost(n) for n in range(EXCEPTIONS)}
        return {n: cost for n, cost in costs.items() if cost.activations or n == 0}

    def stats(self) -> BoardStats:
        """Return the board's totals."""
        stats = native.new(BoardStats)
        self._library.board_stats(self._board, ctypes.byref(stats))
        return native.from_struct(BoardStats, stats)

    def warnings(self) -> list[BoardWarning]:
        """Return the board's warnings so far, each once."""
        found: list[BoardWarning] = []
        hits = ctypes.c_uint64()
        while (text := self._library.board_warning(self._board, len(found), ctypes.byref(hits))) is not None:
            found.append(BoardWarning(text.decode(), hits.value))
        return found

    # the robot

    def truth(self) -> PlantState:
        """Return the true state of the robot, which no sensor measures."""
        state = native.new(PlantState)
        self._library.rig_truth(self._rig, ctypes.byref(state))
        return native.from_struct(PlantState, state)

    def set_unmodelled_effects(self, effects: UnmodelledEffects) -> None:
        """Give the robot effects beyond its parameters from now on."""
        made = native.to_struct(effects)
        if not self._library.rig_set_unmodelled_effects(self._rig, ctypes.byref(made)):
            problem = self._library.plant_unmodelled_effects_problem(ctypes.byref(made))
            raise VirtualRobotError("no robot is connected" if problem is None else problem.decode())

    def place(self, x_m: float, y_m: float, theta_rad: float) -> None:
        """Move the robot to another pose."""
        self._library.rig_place(self._rig, x_m, y_m, theta_rad)

    def record(self, longest_s: float, interval_s: float = 1e-3) -> None:
        """Record the robot's true state from now on, for at most this long."""
        import numpy as np

        from hil_sim.recorded import SAMPLE, steps_of

        self._samples = np.zeros(round(longest_s / interval_s) + 2, SAMPLE)
        self._library.rig_record(
            self._rig, self._samples.ctypes.data, self._samples.size, steps_of(interval_s)
        )

    def recorded(self) -> Samples:
        """Return the samples recorded since `record`; at least an empty array."""
        return self._samples[: int(self._library.rig_recorded(self._rig))]

    def bridge(self, wheel: int) -> tuple[float, float]:
        """Return the fraction of time each bridge input of a wheel is high; below 0: not driven."""
        duty = (ctypes.c_double * 2)()
        self._library.rig_bridge(self._rig, wheel, duty)
        return duty[0], duty[1]

    def led(self) -> float:
        """Return the level of the status LED's pin (PC12); below 0: not driven."""
        return float(self._library.rig_led(self._rig))

    def driver_enable(self) -> float:
        """Return the level of the drivers' enable pin (PC6); below 0: not driven, pulled low outside."""
        return float(self._library.rig_driver_enable(self._rig))

    def wire_driver_enable(self, wired: bool) -> None:
        """Take drivers with an enable input, wired to PC6: without it the motors coast."""
        self._library.rig_wire_driver_enable(self._rig, wired)

    # faults; each acts from now until it is removed

    def set_encoder_fault(self, wheel: int, fault: EncoderFault) -> None:
        """Break (or mend) an encoder; the counts themselves do not jump."""
        self._library.rig_encoder_fault(self._rig, wheel, int(fault))

    def set_encoder_noise(self, wheel: int, noise: EncoderNoise) -> None:
        """Disturb an encoder's lines, or leave them alone (`EncoderNoise()`).

        Raises
        ------
        ValueError : a burst longer than its period, or pulses of no width.
        """
        if not self._library.rig_encoder_noise(self._rig, wheel, ctypes.byref(native.to_struct(noise))):
            raise ValueError(f"no noise of an encoder: {noise}")

    def set_motors_swapped(self, swapped: bool) -> None:
        """Connect each bridge to the other wheel's motor."""
        self._library.rig_swap_motors(self._rig, swapped)

    def set_motor_connected(self, wheel: int, connected: bool) -> None:
        """Pull or plug in a motor's cable."""
        self._library.rig_motor_connected(self._rig, wheel, connected)

    def set_encoders_swapped(self, swapped: bool) -> None:
        """Plug each encoder into the other one's input."""
        self._library.rig_swap_encoders(self._rig, swapped)

    def turn_by_hand(self, wheel: int, turns: float = 1.0, duration_s: float = 1.5) -> None:
        """Turn a lifted wheel by hand, forward when `turns` is positive; takes virtual time."""
        steps = round(duration_s * 2000)
        for _ in range(steps):
            self._library.rig_turn_wheel(self._rig, wheel, 2 * math.pi * turns / steps)
            self.run_us(500)

    def hold_wheel(self, wheel: int, torque_nm: float) -> None:
        """Hold a wheel with dry friction at its axle, as a hand or a kerb does; 0 lets go."""
        self._library.rig_hold_wheel(self._rig, wheel, torque_nm)

    def set_battery_sense_connected(self, connected: bool) -> None:
        """Break or mend the divider's wire: the ADC then reads 0 V while the motors keep their supply."""
        self._library.rig_battery_sense_connected(self._rig, connected)

    def set_battery_cut_off(self, cut_off: bool) -> None:
        """Cut the battery off, as a fuse does: 470 uF then supply the bridges, and take their energy."""
        self._library.rig_cut_off_battery(self._rig, cut_off)

    def set_bench_voltage(self, volts: float | None) -> None:
        """Connect the divider to a bench supply instead of the battery; None: the battery again."""
        self._library.rig_bench_voltage(self._rig, -1.0 if volts is None else volts)

    def set_crystal_alive(self, alive: bool) -> None:
        """Stop or start the crystal."""
        self._library.rig_crystal_alive(self._rig, alive)

    def set_crystal_ppm(self, ppm: float) -> None:
        """Let the crystal be this much faster than 8 MHz from now on, as when its temperature changes."""
        _check_ppm(ppm)
        self._library.rig_crystal_ppm(self._rig, ppm)

    def set_crystal_hz(self, hz: int) -> None:
        """Fit a crystal of another frequency than 8 MHz; meant for a board that is switched off."""
        self._library.rig_crystal_hz(self._rig, hz)

    def set_hsi_hz(self, hz: int) -> None:
        """Let the internal oscillator run at this frequency instead of 16 MHz (14.72 to 16.72 MHz)."""
        self._library.board_set_hsi_hz(self._board, hz)

    def set_pll_dead(self, dead: bool) -> None:
        """Keep the PLL from locking, from its next start on."""
        self._library.board_set_pll_dead(self._board, dead)

    def set_engine_only(self, only: bool) -> None:
        """Leave every instruction to the CPU engine, none to the interpreter: slower, the same otherwise."""
        self._library.board_set_engine_only(self._board, only)

    def set_idcode(self, idcode: int) -> None:
        """Let DBGMCU_IDCODE read this: another revision or chip."""
        self._library.board_set_idcode(self._board, idcode)

    def read_register(self, address: int) -> int:
        """Return a register's value as a debugger reads it, with what reading does to it."""
        return int(self._library.board_read_register(self._board, address))

    def set_power(self, on: bool) -> None:
        """Switch the board's supply; SRAM is noise after each power-on, flash keeps its content."""
        self._library.rig_power(self._rig, on)

    def set_supply(self, volts: float) -> None:
        """Set the chip's own supply, 3.3 V at first; SRAM is noise after less than 1.2 V."""
        self._library.board_set_supply(self._board, volts)

    def option_bytes(self) -> int:
        """Return the option bytes as the chip stores them, in the form of FLASH_OPTCR without its lock."""
        return int(self._library.board_option_bytes(self._board))

    def power_cycle(self) -> None:
        """Switch the board off and on again."""
        self.set_power(False)
        self.set_power(True)

    def reset(self, cause: ResetCause = ResetCause.PIN) -> None:
        """Reset the chip as the given cause would; SRAM keeps its content except after POWER."""
        if cause is ResetCause.POWER:
            self.power_cycle()
        else:
            self._library.rig_reset(self._rig, int(cause))

    def set_emergency_stop(self, pressed: bool) -> None:
        """Press or release the emergency stop; a broken wire is the same as a pressed one."""
        self._library.rig_emergency_stop(self._rig, pressed)

    def open_pin(self, port: str, number: int) -> None:
        """Break whatever wire holds a pin low or high; its pull resistor decides its level from now on."""
        pin = native.HEADERS.structs["board_pin"](port.encode(), number)
        self._library.board_set_pin(self._board, pin, _CONSTANTS["BOARD_OPEN"])

    def set_halted(self, halted: bool) -> None:
        """Halt the core as a debugger does, or let it go on; peripherals run on unless DBGMCU stops them."""
        self._library.board_set_halted(self._board, halted)

    def set_lsi_hz(self, hz: int) -> None:
        """Let the watchdog's oscillator run at this frequency from the next reset on (17 to 47 kHz)."""
        self._library.board_set_lsi_hz(self._board, hz)

    def set_flash_slow(self, slow: bool) -> None:
        """Let flash take the longest times of the datasheet instead of the typical ones."""
        self._library.board_set_flash_slow(self._board, slow)

    def count_flash_waits(self) -> None:
        """Include flash wait states in the CPU's cycles from now on; the emulation gets slower by it."""
        if not self._library.board_count_flash_waits(self._board):
            raise VirtualRobotError("the CPU engine takes no hook on flash")

    def set_adc_dead(self, dead: bool) -> None:
        """Stop every ADC from completing conversions, or let them complete again."""
        self._library.board_set_adc_dead(self._board, dead)

    def set_interrupt_stuck(self, irq: int, stuck: bool) -> None:
        """Hold an interrupt's request line high: its handler is called again as soon as it has returned."""
        self._library.board_set_interrupt_stuck(self._board, irq, stuck)

    def cut_power_at_flash_write(self, operations: int | None) -> None:
        """Fail the supply in the middle of a flash erase or programming, after this many whole ones.

        How far the torn operation got, and which bits it reached, is drawn from the board's seed.
        """
        self._library.board_cut_power_at_flash_write(self._board, -1 if operations is None else operations)

    def cut_power_at_instruction(self, instructions: int | None) -> None:
        """Fail the supply after this many more instructions, at the end of their stretch without a branch."""
        n = -1 if instructions is None else instructions
        self._library.board_cut_power_at_instruction(self._board, n)

    def write_flash(self, addr: int, data: bytes) -> None:
        """Write bytes into flash as a programmer does; meant for a board that is switched off."""
        inside = addr in _FLASH and addr + len(data) <= _FLASH.stop
        if not (inside and self._library.rig_flash(self._rig, addr, bytes(data), len(data))):
            raise VirtualRobotError(f"there is no flash of {len(data)} bytes at 0x{addr:08X}")


def _check_ppm(ppm: float) -> None:
    if not abs(ppm) <= _MAX_PPM:
        raise VirtualRobotError(f"a crystal error of {ppm:g} ppm is beyond {_MAX_PPM:g} ppm")
