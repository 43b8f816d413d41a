"""Pages of the documentation site that are made from the code when the site is built."""

from __future__ import annotations

from site_pages import commands, effects, messages, python_api

GENERATORS = (commands, effects, python_api, messages)


def generated_pages() -> dict[str, str]:
    """Markdown of every generated page by its path in the site."""
    pages: dict[str, str] = {}
    for generator in GENERATORS:
        pages |= generator.pages()
    return pages


def navigation() -> dict[str, list[object]]:
    """What the generated pages add to the navigation, by the title of the section that they go into."""
    return {
        "Commands": commands.navigation(),
        "Effects": effects.navigation(),
    }
