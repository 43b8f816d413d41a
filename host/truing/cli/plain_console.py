"""Output to consoles and pipes whose encoding lacks a sign: a plain word or mark stands for it.

Windows gives a pipe its code page (cp1252, cp437). Python refuses to write what these lack, in the middle of
a command. (ASCII, which a system without a locale gives, click takes for UTF-8.)
"""

from __future__ import annotations

import codecs
import io
import sys
import unicodedata

ERRORS = "truing-plain"
_WORDS = {
    "→": "->",
    "←": "<-",
    "↑": "up",
    "↓": "down",
    "−": "-",
    "–": "-",
    "…": "...",
    "·": ".",
    "×": "x",
    "±": "+-",
    "°": "deg",
    "²": "^2",
    "µ": "u",
    "μ": "u",
    "τ": "tau",
    "θ": "theta",
    "φ": "phi",
    "α": "alpha",
    "ω": "omega",
}
# The blocks of a course, low to high.
_BLOCKS = dict(zip("▁▂▃▄▅▆▇█", "_.,-=+*#", strict=True))


def plain(text: str) -> str:
    """The text in ASCII: words for signs, letters without their accents, a question mark for the rest."""
    return "".join(map(_plain, text))


def _plain(sign: str) -> str:
    if sign.isascii():
        return sign
    known = _WORDS.get(sign) or _BLOCKS.get(sign)
    if known is not None:
        return known
    name = unicodedata.name(sign, "")
    if name.startswith("BOX DRAWINGS"):
        return "|" if "VERTICAL" in name and "HORIZONTAL" not in name else "-"
    letters = unicodedata.normalize("NFKD", sign).encode("ascii", "ignore").decode("ascii")
    return letters or "?"


def _replaced(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return plain(error.object[error.start : error.end]), error.end


def let_every_sign_be_written() -> None:
    """Replace what the standard streams cannot encode; a stream in UTF-8 writes all as it is."""
    codecs.register_error(ERRORS, _replaced)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=ERRORS)
