"""The login token: shown once when it is made, stored as a salted hash."""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import secrets
from dataclasses import dataclass
from pathlib import Path

from palpate.foundation.errors import SetupError

__all__ = ["FILE", "Token"]

FILE = "login.json"
COST = {"n": 2**14, "r": 8, "p": 1}
"""Parameters of scrypt: 16 MB and about 50 ms for each guess."""


@dataclass(frozen=True)
class Token:
    """Salt and scrypt hash (RFC 7914) of a token."""

    salt: bytes
    digest: bytes

    @classmethod
    def make(cls, folder: Path) -> str:
        """Make a token that replaces any before; its hash goes to a file that only its owner can
        read.
        """
        text, salt = secrets.token_urlsafe(24), secrets.token_bytes(16)
        folder.mkdir(parents=True, exist_ok=True)
        aside = folder / f".{FILE}-{secrets.token_hex(4)}"
        with os.fdopen(os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            json.dump({"format": 1, "salt": salt.hex(), "scrypt": _hash(text, salt).hex()}, file)
        aside.replace(folder / FILE)
        return text

    @classmethod
    def load(cls, folder: Path) -> Token:
        """Read the token of a folder; raises SetupError if it is missing, unreadable, or readable
        by others.
        """
        path = folder / FILE
        try:
            mode = path.stat().st_mode & 0o777
            stored = json.loads(path.read_text())
            token = cls(bytes.fromhex(stored["salt"]), bytes.fromhex(stored["scrypt"]))
        except FileNotFoundError as error:
            raise SetupError(
                f"{path}: there is no token; make one with palpate serve --new-token", key="token"
            ) from error
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SetupError(
                f"{path} cannot be read; make a token with palpate serve --new-token", key="token"
            ) from error
        if mode & 0o077:
            raise SetupError(
                f"{path} has mode {mode:o}: others may read it; chmod 600 it",
                key="token",
                value=f"{mode:o}",
            )
        return token

    def matches(self, text: str) -> bool:
        """Whether this is the token, compared in constant time."""
        return hmac.compare_digest(self.digest, _hash(text, self.salt))


def _hash(text: str, salt: bytes) -> bytes:
    return hashlib.scrypt(text.encode(), salt=salt, dklen=32, **COST)
