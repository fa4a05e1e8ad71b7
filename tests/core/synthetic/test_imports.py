"""What the virtual bench imports."""

from __future__ import annotations

import re
from pathlib import Path

import palpate.synthetic
from palpate.blind.dataset_store import BENCH


def test_bench_imports_only_the_folders_that_the_store_of_datasets_watches() -> None:
    root = Path(palpate.synthetic.__path__[0])
    text = "\n".join(path.read_text() for path in root.rglob("*.py"))
    assert set(re.findall(r"(?:from|import) palpate\.(\w+)", text)) == set(BENCH)
