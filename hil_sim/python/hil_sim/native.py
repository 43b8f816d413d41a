"""The C library of board and rig as ctypes sees it: where it lies, its functions and its structs."""

from __future__ import annotations

import ctypes
import functools
from pathlib import Path
from typing import Any

from hil_sim.plant import LIBRARY

_P = ctypes.c_void_p
_U8, _U32, _U64, _I64 = ctypes.c_uint8, ctypes.c_uint32, ctypes.c_uint64, ctypes.c_int64
_INT, _BOOL, _DOUBLE, _SIZE = ctypes.c_int, ctypes.c_bool, ctypes.c_double, ctypes.c_size_t


class Cost(ctypes.Structure):
    """`struct board_cost` of board.h."""

    _fields_ = [
        (name, _U64)
        for name in ("activations", "instructions", "worst_instructions", "cycles", "worst_cycles")
    ]


class Stats(ctypes.Structure):
    """`struct board_stats` of board.h."""

    _fields_ = [
        *((name, _U64) for name in ("cycles", "sleep_cycles", "instructions", "interrupts", "tail_chains")),
        ("registers", _U64),
        ("resets", _U64),
        ("core_hz", _U32),
        ("locked_up", _BOOL),
        ("powered", _BOOL),
    ]


class CanBusFrame(ctypes.Structure):
    """`struct can_bus_frame` of can_bus.h."""

    _fields_ = [
        ("time_us", _U64),
        ("id", _U32),
        *((name, _U8) for name in ("extended", "remote", "length")),
        ("data", _U8 * 8),
    ]


class CanBusTotals(ctypes.Structure):
    """`struct can_bus_totals` of can_bus.h."""

    _fields_ = [(name, _U64) for name in ("frames", "bits", "damaged", "unacknowledged")]


_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "rig_create": (_P, [_P, _U64, ctypes.c_char_p, _BOOL]),
    "rig_destroy": (None, [_P]),
    "rig_board": (_P, [_P]),
    "rig_flash": (_BOOL, [_P, _U32, ctypes.c_char_p, _SIZE]),
    "rig_run_us": (None, [_P, _U64]),
    "rig_time_us": (_U64, [_P]),
    "rig_link_write": (None, [_P, ctypes.c_char_p, _SIZE]),
    "rig_link_read": (_SIZE, [_P, _P, _SIZE]),
    "rig_link_pending": (_SIZE, [_P]),
    "rig_link_baud": (None, [_P, _DOUBLE]),
    "rig_truth": (None, [_P, _P]),
    "rig_hide": (_BOOL, [_P, _P]),
    "rig_place": (None, [_P, _DOUBLE, _DOUBLE, _DOUBLE]),
    "rig_record": (_BOOL, [_P, _P, _SIZE, _U64]),
    "rig_recorded": (_SIZE, [_P]),
    "plant_hidden_problem": (ctypes.c_char_p, [_P]),
    "rig_bridge": (None, [_P, _INT, _P]),
    "rig_led": (_DOUBLE, [_P]),
    "rig_encoder_fault": (None, [_P, _INT, _INT]),
    "rig_swap_motors": (None, [_P, _BOOL]),
    "rig_motor_connected": (None, [_P, _INT, _BOOL]),
    "rig_turn_wheel": (None, [_P, _INT, _DOUBLE]),
    "rig_swap_encoders": (None, [_P, _BOOL]),
    "rig_hold_wheel": (None, [_P, _INT, _DOUBLE]),
    "rig_battery_sense_connected": (None, [_P, _BOOL]),
    "rig_bench_voltage": (None, [_P, _DOUBLE]),
    "rig_crystal_alive": (None, [_P, _BOOL]),
    "rig_crystal_ppm": (None, [_P, _DOUBLE]),
    "rig_power": (None, [_P, _BOOL]),
    "rig_reset": (None, [_P, _INT]),
    "board_set_flash_slow": (None, [_P, _BOOL]),
    "can_bus_create": (_P, [_DOUBLE]),
    "can_bus_destroy": (None, [_P]),
    "can_bus_bit_rate": (None, [_P, _DOUBLE]),
    "can_bus_attach": (_BOOL, [_P, _P]),
    "can_bus_detach": (None, [_P, _P]),
    "can_bus_run_us": (None, [_P, _U64]),
    "can_bus_write": (_BOOL, [_P, _P]),
    "can_bus_read": (_BOOL, [_P, _P]),
    "can_bus_connect_host": (None, [_P, _BOOL]),
    "can_bus_short": (None, [_P, _BOOL]),
    "can_bus_damage": (None, [_P, _U64]),
    "can_bus_totals": (None, [_P, _P]),
    "board_set_adc_dead": (None, [_P, _BOOL]),
    "board_set_interrupt_stuck": (None, [_P, ctypes.c_uint, _BOOL]),
    "board_cut_power_at_flash_write": (None, [_P, _I64]),
    "board_cut_power_at_instruction": (None, [_P, _I64]),
    "board_read_memory": (_BOOL, [_P, _U32, _P, _SIZE]),
    "board_write_memory": (_BOOL, [_P, _U32, ctypes.c_char_p, _SIZE]),
    "board_trace_hash": (None, [_P, _P]),
    "board_trace_count": (_U64, [_P]),
    "board_next_tick_ps": (_U64, [_P]),
    "board_cost": (None, [_P, ctypes.c_uint, _P]),
    "board_stats": (None, [_P, _P]),
    "board_warning": (ctypes.c_char_p, [_P, _SIZE, _P]),
}


@functools.cache
def load(path: Path = LIBRARY) -> ctypes.CDLL:
    """Return the library with its functions declared.

    Raises
    ------
    OSError : the library is not built or cannot be loaded.
    """
    library = ctypes.CDLL(str(path))
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
    return library
