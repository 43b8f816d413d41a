"""Writing MATLAB files whole or not at all."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, cast

from truing.recording.writer import replace_file


def write_mat(path: Path, values: dict[str, Any]) -> None:
    """A version 5 .mat file, which every MATLAB since 1999 and Octave read."""
    import scipy.io

    stream = io.BytesIO()
    # Its type hints know paths only; it writes to streams as well.
    scipy.io.savemat(
        cast("Any", stream), values, do_compression=True, oned_as="column", long_field_names=True
    )
    replace_file(path, stream.getvalue())
