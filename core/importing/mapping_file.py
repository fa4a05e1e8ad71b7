"""Reading and writing of import.toml."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from palpate.dataset.files import read_toml
from palpate.foundation.errors import DatasetError
from palpate.importing.rules import ImportMapping

__all__ = ["MAPPING", "mapping_text", "read_mapping", "toml_text"]

MAPPING = "import.toml"
"""Name of the file within a dataset."""
_LIMIT = 2**22
_HEAD = """\
# How these recordings become a dataset. Edit, and run again:
#   palpate import --mapping import.toml --to FOLDER
"""


def read_mapping(path: Path) -> ImportMapping:
    """Read import.toml; DatasetError names the key, the value and what is expected."""
    values = read_toml(path.parent, path.name, _LIMIT)
    try:
        return ImportMapping.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        found = "" if first["type"] == "missing" else f" = {str(first['input'])[:60]!r}"
        raise DatasetError(
            f"{path.name}: {key}{found}: {first['msg'].lower()}; correct this key",
            file=path.name,
            key=key,
        ) from None


def mapping_text(mapping: ImportMapping) -> str:
    """Write a mapping as TOML."""
    return _HEAD + toml_text(mapping.model_dump(mode="json"))


def toml_text(values: dict[str, Any], prefix: str = "") -> str:
    """Write tables of texts, numbers, truths, lists and tables as TOML."""
    plain = {key: one for key, one in values.items() if not _is_table(one)}
    lines = [f"{_key(key)} = {_value(one)}" for key, one in plain.items()]
    text = "\n".join(lines) + ("\n" if lines else "")
    for key, one in values.items():
        name = f"{prefix}{_key(key)}"
        if isinstance(one, dict):
            text += f"\n[{name}]\n" + toml_text(one, f"{name}.")
        elif _is_table(one):
            text += "".join(f"\n[[{name}]]\n" + toml_text(part, f"{name}.") for part in one)
    return text


def _is_table(value: Any) -> bool:
    if isinstance(value, dict):
        return True
    return isinstance(value, list) and bool(value) and all(isinstance(one, dict) for one in value)


def _key(key: str) -> str:
    plain = key.replace("_", "").replace("-", "")
    return key if plain.isascii() and plain.isalnum() else json.dumps(key, ensure_ascii=False)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(one) for one in value) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_value(one)}" for key, one in value.items()) + " }"
    return repr(value)
