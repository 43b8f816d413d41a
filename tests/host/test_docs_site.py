"""The site has a whole page for every command and effect, and quotes only messages that the code gives."""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from truing import errors
from truing.cli import COMMANDS, GROUPS
from truing.diagnose.catalogue import CATALOGUE

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


def generator(name: str) -> ModuleType:
    """A module of docs/site/site_pages."""
    folder = str(DOCS / "site")
    if folder not in sys.path:
        sys.path.insert(0, folder)
    return importlib.import_module(f"site_pages.{name}")


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    """Every generated page by its path."""
    generator("commands")
    made: dict[str, str] = sys.modules["site_pages"].generated_pages()
    return made


def sections(page: str) -> dict[str, str]:
    """The text below each heading of a page, down to the next one."""
    text = re.sub(r"^```.*?^```", lambda match: match.group().replace("#", ""), page, flags=re.M | re.S)
    _, *parts = re.split(r"^(#+ .+)$", text, flags=re.M)
    return {title.lstrip("# "): body.strip() for title, body in zip(parts[::2], parts[1::2], strict=True)}


def test_every_command_has_a_page_with_its_usage_and_help(pages: dict[str, str]) -> None:
    for name in COMMANDS:
        text = pages[f"reference/commands/{name}.md"]
        assert text.startswith(f"# truing {name}\n\n```console\ntruing {name}")
        assert "\b" not in text


def test_the_overview_has_the_commands_in_the_groups_of_the_help(pages: dict[str, str]) -> None:
    found = sections(pages["reference/commands/index.md"])
    for title, lines in GROUPS.items():
        assert re.findall(r"\[`truing ([\w-]+)`\]", found[title]) == list(lines)


def test_subcommands_are_on_the_page_of_their_command(pages: dict[str, str]) -> None:
    assert {"truing log fetch", "truing log arm", "truing log erase"} <= set(
        sections(pages["reference/commands/log.md"])
    )


@pytest.mark.parametrize("name", CATALOGUE)
def test_an_effect_has_a_whole_page(pages: dict[str, str], name: str) -> None:
    effect = CATALOGUE[name]
    found = sections(pages[f"reference/effects/{name}.md"])
    headings = ["Equation", "Parameters", "How it looks in a recording", "What it is confused with"]
    assert list(found)[1:] == [*headings, "How to excite it"]
    assert [title for title, body in found.items() if len(body.split()) < 8] == []
    equation = re.match(r"```text\n(.+?)\n```", found["Equation"], re.S)
    assert equation is not None
    assert re.search(r"[=*<+-]", equation.group(1))
    assert set(re.findall(r"^\| `(\w+)` \|", found["Parameters"], re.M)) == set(
        generator("effects").reported_names(effect)
    )
    for other, run in effect.separated_by.items():
        assert f"| [`{other}`]({other}.md) | {run}" in found["What it is confused with"].replace("\\", "")


def test_no_generated_page_has_an_empty_section(pages: dict[str, str]) -> None:
    assert len(pages) == len(COMMANDS) + len(CATALOGUE) + 4
    for path, text in pages.items():
        # A heading may be followed at once by a deeper one, never by one of its own level or by the end.
        lines = [line for line in re.sub(r"^```.*?^```", "code", text, flags=re.M | re.S).split("\n") if line]
        for line, after in zip(lines, [*lines[1:], "# end"], strict=True):
            if line.startswith("#") and after.startswith("#"):
                assert after.index(" ") > line.index(" "), f"{path}: {line}"


def test_every_verb_and_every_error_is_on_the_page_of_the_python_api(pages: dict[str, str]) -> None:
    text = pages["reference/python-api.md"]
    for verb in ("read", "identify", "fit", "simulate", "diagnose", "export"):
        assert {f"Parameters of {verb}", f"Returns of {verb}"} <= set(sections(text))
        assert f"def {verb}(" in text
    kinds = [name for name, kind in vars(errors).items() if isinstance(kind, type) and name[0] != "_"]
    listed = set(re.findall(r"^\| `(\w+)` \|", sections(text)["Errors"], re.M))
    assert {"TruingError", "RecordingError"} <= listed <= set(kinds)


def test_messages_are_read_with_their_next_step() -> None:
    found = {(one.kind, one.text): one.next_step for one in generator("messages").messages()}
    assert found["RecordingError", "the file is empty"] == "Record the run, or fetch its log, again"
    # A computed part, a next step by keyword, a text that a variable holds.
    rows = found["RecordingError", "time runs backwards, from … s to … s"]
    assert rows == "Split the file where the recorder restarted: one file per run"
    assert any(kind == "Check" and text.startswith("both wheels always") for kind, text in found)


def test_every_message_that_troubleshooting_quotes_is_in_the_code() -> None:
    quoted = re.findall(r"^### `(.+)`$", (DOCS / "TROUBLESHOOTING.md").read_text(encoding="utf-8"), re.M)
    known = [one.text for one in generator("messages").messages()]
    assert len(quoted) >= 20
    # A long message may end with `, …` early.
    missing = [
        text
        for text in quoted
        if text not in known
        and not (text.endswith(", …") and any(one.startswith(text[:-1]) for one in known))
    ]
    assert missing == []


def test_links_between_docs_and_the_rest_of_the_repository_hold_in_the_site() -> None:
    repository = generator("repository")
    copied = repository.copied_pages()
    site = {repository.place(path) for path in copied} | {"BRINGUP.md", "howto/board.md"}
    needed: list[str] = []
    text = (
        "[a](../../firmware/README.md#pins) `docs/BRINGUP.md` [b](../../run) [c](https://x.org) "
        "[d](../../host/truing/cli/import_.py)"
    )
    assert repository.linked(text, "howto/board.md", site, needed.append) == (
        "[a](../repository/firmware/README.md#pins) [`docs/BRINGUP.md`](../BRINGUP.md) "
        "[b](../repository/run) [c](https://x.org) [d](../reference/commands/import.md)"
    )
    assert needed == ["run"]
    assert "firmware/README.md" in copied
    assert repository.linked("```\n`docs/BRINGUP.md`\n```", "index.md", site, needed.append).count("](") == 0


def test_the_assets_of_the_site_fetch_nothing_from_elsewhere() -> None:
    settings = (DOCS / "site/mkdocs.yml").read_text(encoding="utf-8")
    assert "font: false" in settings
    texts = [settings, *(path.read_text(encoding="utf-8") for path in (DOCS / "site/assets").iterdir())]
    assert not any(re.search(r"https?://", text) for text in texts)
