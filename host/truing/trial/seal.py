"""Sealed answers: a hash that is shown first, and the salted answer that must fit it afterwards."""

from __future__ import annotations

import hashlib
import json
import secrets
from typing import Any

from truing.errors import BrokenSealError


def seal(answer: dict[str, Any]) -> tuple[str, str]:
    """Return the SHA-256 to show, and the sealed text that it is of.

    The random salt keeps anybody from trying all answers until one has the hash.
    """
    text = json.dumps({"salt": secrets.token_hex(16), "answer": answer}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest(), text


def open_seal(shown: str, text: str) -> dict[str, Any]:
    """Return the answer in a sealed text, after checking it against the hash shown before.

    Raises
    ------
    BrokenSealError : it is another text than the one that was sealed.
    """
    found = hashlib.sha256(text.encode()).hexdigest()
    if found != shown:
        raise BrokenSealError(
            f"the seal is broken: the answer has the hash {found}, shown was {shown}",
            "do not believe this trial",
        )
    answer: dict[str, Any] = json.loads(text)["answer"]
    return answer
