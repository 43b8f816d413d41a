"""A model as the file of another program, zipped where it is more than one."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any


def export(model: Path, kind: str, folder: Path) -> dict[str, Any]:
    """Write a model as a kind into a folder: the path, and what the kind cannot hold.

    Raises
    ------
    TruingError : the model cannot be read, or lacks what the kind needs.
    """
    from truing.exporters import ExportOptions, exporters, notes, read_model

    folder.mkdir(parents=True, exist_ok=True)
    read, unused = read_model(model)
    exporter, options = exporters()[kind], ExportOptions()
    files = exporter.write(read, folder / f"{model.stem}_{kind}{exporter.SUFFIX}", options)
    main = files[0]
    if len(files) > 1:
        main = folder / f"{model.stem}_{kind}.zip"
        with zipfile.ZipFile(main, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in files:
                archive.write(file, file.relative_to(folder))
    return {"file": str(main), "notes": [*unused, *notes(kind, read, options)]}
