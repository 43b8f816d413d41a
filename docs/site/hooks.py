"""MkDocs hook: adds generated pages and pages outside docs/, and makes links between all of them hold."""

from __future__ import annotations

from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from site_pages import generated_pages, navigation, repository
from site_pages.repository import ROOT, copied, copied_pages, linked, place


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Fill the navigation's sections of generated and copied pages."""
    sections = navigation()
    sections["Repository"] = repository.navigation()
    missing = set(sections) - _fill(config.nav, sections)
    assert not missing, f"mkdocs.yml has no section {missing}"
    return config


def _fill(items: Any, sections: dict[str, list[object]]) -> set[str]:
    """Put the sections' pages into the navigation; returns the titles that were found."""
    found: set[str] = set()
    for item in items:
        for title, content in item.items() if isinstance(item, dict) else ():
            if title in sections:
                item[title] = sections[title]
                found.add(title)
            elif isinstance(content, list):
                found |= _fill(content, sections)
    return found


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what is not in docs/: generated pages, copied pages, and the files that those link to."""
    texts = generated_pages()
    texts |= {place(path): copied(path) for path in copied_pages()}
    for file in files.documentation_pages():
        texts[file.src_uri] = file.content_string
    pages, extra = set(texts), set[str]()
    for uri, text in texts.items():
        old = files.get_file_from_path(uri)
        if old is not None:
            files.remove(old)
        files.append(File.generated(config, uri, content=linked(text, uri, pages, extra.add)))
    for path in sorted(extra):
        files.append(File.generated(config, place(path), abs_src_path=str(ROOT / path)))
    return files
