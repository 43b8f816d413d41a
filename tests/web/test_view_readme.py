"""The README of the view names every module and script, and nothing that does not exist."""

from __future__ import annotations

import re
from pathlib import Path


def test_the_readme_names_every_module(root: Path) -> None:
    web = root / "host/truing/web"
    found = {
        str(path.relative_to(web))
        for pattern in ("**/*.py", "static/*")
        for path in web.glob(pattern)
        if path.name != "__init__.py"
    }
    text = (web / "README.md").read_text(encoding="utf-8")
    tables = "".join(line for line in text.splitlines() if line.startswith("| `"))
    named = set(re.findall(r"`((?:\w+/)?\w+\.(?:py|js|css))`", tables))
    assert found == named
