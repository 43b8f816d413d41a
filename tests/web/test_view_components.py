"""Every component of the pages has its script, and every script and picture is part of the package."""

from __future__ import annotations

import re

import pytest


@pytest.fixture
def components():
    from truing.web.pages import components

    return components


def test_every_component_has_its_script(components):
    from nicegui.element import Element

    classes = [
        found
        for found in vars(components).values()
        if isinstance(found, type) and issubclass(found, Element) and found.__module__ == components.__name__
    ]
    assert components.Plot in classes
    for found in classes:
        assert found.component is not None, found
        assert found.component.path.parent == components.STATIC, found


def test_every_file_that_pages_and_scripts_ask_for_is_there(components):
    sources = [*components.STATIC.glob("*.js"), *components.STATIC.parent.glob("**/*.py")]
    named = {name for path in sources for name in re.findall(r"/view-static/([\w.]+)", path.read_text())}
    assert {"live.js", "theme.css"} <= named
    assert all((components.STATIC / name).is_file() for name in named)
