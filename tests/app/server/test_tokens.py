from __future__ import annotations

from pathlib import Path

import pytest

from palpate.app.server.tokens import FILE, Token
from palpate.foundation.errors import SetupError


def test_token_is_known_again_and_lies_nowhere_as_text(tmp_path: Path) -> None:
    text = Token.make(tmp_path / "runs")
    path = tmp_path / "runs" / FILE
    assert Token.load(path.parent).matches(text)
    assert not Token.load(path.parent).matches(text + "x")
    assert text not in path.read_text()
    assert path.stat().st_mode & 0o777 == 0o600
    assert [found.name for found in path.parent.iterdir()] == [FILE]


def test_new_token_ends_the_one_before(tmp_path: Path) -> None:
    before = Token.make(tmp_path)
    assert (
        Token.load(tmp_path).matches(Token.make(tmp_path)) is False
    )  # loaded before the new one was made
    assert not Token.load(tmp_path).matches(before)


def test_missing_broken_and_open_files_say_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(SetupError, match="no token; make one with palpate serve --new-token"):
        Token.load(tmp_path)
    Token.make(tmp_path)
    (tmp_path / FILE).chmod(0o644)
    with pytest.raises(SetupError, match="mode 644: others may read it; chmod 600"):
        Token.load(tmp_path)
    (tmp_path / FILE).write_text("{}")
    with pytest.raises(SetupError, match="cannot be read"):
        Token.load(tmp_path)
