"""Commands and modules that the documentation names are there."""

from __future__ import annotations

import importlib
import importlib.util
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer

from palpate.app.cli import app

ROOT = Path(__file__).parents[2]
TEXTS = [ROOT / "README.md", *sorted((ROOT / "docs" / "pages").glob("*.md"))]
COMMAND = re.compile(r"^palpate (.+?)(?:\s+#.*)?$", re.MULTILINE)
MODULE = re.compile(r"`(palpate(?:\.\w+)+)`")


def _commands() -> list[tuple[str, str]]:
    """Lines of shell blocks that call palpate, with the file they stand in."""
    blocks = (
        (text.name, block)
        for text in TEXTS
        for block in re.findall(r"```bash\n(.*?)```", text.read_text(encoding="utf-8"), re.DOTALL)
    )
    return [(name, line) for name, block in blocks for line in COMMAND.findall(block)]


@pytest.mark.parametrize(("name", "line"), _commands())
def test_command_line_is_understood(name: str, line: str) -> None:
    group: Any = typer.main.get_command(app)
    verb, *words = shlex.split(line)
    assert verb in group.commands, f"{name}: there is no verb {verb}"
    known = {
        option
        for item in group.commands[verb].params
        for option in (*item.opts, *item.secondary_opts)
    }
    unknown = [word for word in words if word.startswith("-") and word not in known]
    assert unknown == [], f"{name}: palpate {line}"


@pytest.mark.parametrize("text", TEXTS, ids=lambda text: text.name)
def test_modules_that_are_named_can_be_found(text: Path) -> None:
    if text.name == "module-names.md":
        named = re.findall(r"\| `(palpate[\w.]+)` \|$", text.read_text(), re.MULTILINE)
    else:
        named = MODULE.findall(text.read_text(encoding="utf-8"))
    assert [name for name in named if not _is_known(name)] == []


def _is_known(name: str) -> bool:
    """Whether a dotted name is a module, or something in one."""
    try:
        if importlib.util.find_spec(name) is not None:
            return True
    except (ModuleNotFoundError, ImportError):
        pass
    module, _, attribute = name.rpartition(".")
    if not module:
        return False
    try:
        return hasattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError:
        return False


def test_scripts_in_pages_are_included_and_there() -> None:
    lines = [line for text in TEXTS for line in text.read_text().split("\n") if "--8" in line]
    assert len(lines) >= 4
    for line in lines:
        included = re.fullmatch(r'--8<-- "(\S+)"', line)
        assert included and (ROOT / included[1]).is_file(), line
