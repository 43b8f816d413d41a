"""The virtual robot: the flashed image on a virtual STM32F405, wired to a simulated robot."""

from hil_sim.can_bus import CanFrame, CanTotals, VirtualCanBus
from hil_sim.elf import ElfError, Image
from hil_sim.oscillators import Oscillators
from hil_sim.plant import PlantError, PlantState, RobotParameters
from hil_sim.robot import (
    DEFAULT_BOARD_ID,
    BoardStats,
    BoardWarning,
    EncoderFault,
    EncoderNoise,
    ExceptionCost,
    ResetCause,
    Target,
    VirtualRobot,
    VirtualRobotError,
)
from hil_sim.unmodelled_effects import UnmodelledEffects

__all__ = [
    "DEFAULT_BOARD_ID",
    "BoardStats",
    "BoardWarning",
    "CanFrame",
    "CanTotals",
    "ElfError",
    "EncoderFault",
    "EncoderNoise",
    "ExceptionCost",
    "Image",
    "Oscillators",
    "PlantError",
    "PlantState",
    "ResetCause",
    "RobotParameters",
    "Target",
    "UnmodelledEffects",
    "VirtualCanBus",
    "VirtualRobot",
    "VirtualRobotError",
]
