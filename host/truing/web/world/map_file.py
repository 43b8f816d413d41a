"""Map files: a PNG image and a YAML file, in the format of ROS's map_server.

The YAML names the image, metres per pixel, the pose of its lower left corner and two thresholds; a pixel
of value v means occupied with probability (255 - v) / 255, or v / 255 when `negate` is set
(map_server's documentation, "Value Interpretation"). The values written are 0, 205 and 254.
"""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from truing.errors import FileError, OutputError, TruingError
from truing.web.world.world_map import WorldMap, check_size

ByteArray: TypeAlias = NDArray[np.uint8]

OCCUPIED, UNKNOWN, FREE = 0, 205, 254
_OCCUPIED_THRESHOLD, _FREE_THRESHOLD = 0.65, 0.196


def write_map(yaml_path: Path, pixels: ByteArray, resolution_m: float, origin_m: tuple[float, float]) -> None:
    """Write a map.

    Parameters
    ----------
    yaml_path : path ending in `.yaml`; the image has the same name with `.png`.
    pixels : shape (rows, columns) of OCCUPIED, UNKNOWN and FREE, row 0 lowest in y.
    """
    image = yaml_path.with_suffix(".png")
    content = {
        "image": image.name,
        "mode": "trinary",
        "resolution": float(resolution_m),
        "origin": [float(origin_m[0]), float(origin_m[1]), 0.0],
        "negate": 0,
        "occupied_thresh": _OCCUPIED_THRESHOLD,
        "free_thresh": _FREE_THRESHOLD,
    }
    try:
        yaml_path.parent.mkdir(parents=True, exist_ok=True)
        image.write_bytes(png_bytes(pixels))
        yaml_path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise OutputError(yaml_path, f"cannot be written ({error.strerror})") from error


def write_world(yaml_path: Path, world: WorldMap) -> None:
    """Write the painted world; every cell is either occupied or free."""
    pixels = np.where(world.occupied, OCCUPIED, FREE).astype(np.uint8)
    write_map(yaml_path, pixels, world.resolution_m, world.origin_m)


def png_bytes(pixels: ByteArray) -> bytes:
    """A grey PNG of an array whose row 0 is the lowest in y."""
    out = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels[::-1])).save(out, format="PNG")
    return out.getvalue()


def read_world(yaml_path: Path) -> WorldMap:
    """Read a map; unknown cells count as free.

    Raises
    ------
    FileError : one of the two files cannot be read, or has content that is not supported.
    """
    try:
        content = yaml.safe_load(yaml_path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(yaml_path, f"cannot be read ({error.strerror})") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise FileError(yaml_path, f"is not YAML: {str(error).splitlines()[0]}") from error
    if not isinstance(content, dict) or not isinstance(content.get("image"), str):
        raise FileError(
            yaml_path, "image: is missing", "a map's YAML file must name its image, as for map_server"
        )
    image = yaml_path.parent / content["image"]
    try:
        return world_of(image.read_bytes(), content, str(yaml_path))
    except OSError as error:
        raise FileError(image, f"cannot be read ({error.strerror})") from error


def world_of(image: bytes, content: dict[str, Any], where: str) -> WorldMap:
    """The world described by an image (PNG or PGM) and the content of its YAML file."""
    resolution = _number(content, "resolution", where)
    if resolution <= 0:
        raise TruingError(f"{where}: resolution: must be positive")
    origin = content.get("origin", [0.0, 0.0, 0.0])
    if not isinstance(origin, list) or len(origin) < 2 or not all(isinstance(o, int | float) for o in origin):
        raise TruingError(f"{where}: origin: must be [x, y, yaw]")
    if len(origin) > 2 and origin[2]:
        raise TruingError(f"{where}: origin: a rotated map (yaw {origin[2]:g}) is not supported")
    threshold = _number(content, "occupied_thresh", where, _OCCUPIED_THRESHOLD)
    try:
        with Image.open(io.BytesIO(image)) as opened:
            check_size(opened.height, opened.width)
            grey = np.asarray(opened.convert("L"), dtype=np.float64)
    except (UnidentifiedImageError, OSError, Image.DecompressionBombError) as error:
        raise TruingError(f"{where}: its image cannot be read") from error
    occupancy = grey / 255.0 if content.get("negate") else 1.0 - grey / 255.0
    occupied = np.ascontiguousarray((occupancy > threshold)[::-1])
    return WorldMap(occupied, resolution, (float(origin[0]), float(origin[1])))


def _number(content: dict[str, Any], key: str, where: str, default: float | None = None) -> float:
    value = content.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise TruingError(f"{where}: {key}: must be a number")
    return float(value)
