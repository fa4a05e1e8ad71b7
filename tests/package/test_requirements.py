"""The pinned versions and hashes of what Palpate needs to run."""

from __future__ import annotations

import re
from importlib.metadata import distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
CUDA = ("cuda-", "nvidia-", "triton")
"""Beginnings of what another build of torch needs."""


def _locked() -> dict[str, tuple[str, int]]:
    """Return version and number of hashes of each package in .ci/requirements.txt, by name."""
    text = re.sub(r"^#.*\n", "", (ROOT / ".ci" / "requirements.txt").read_text(), flags=re.M)
    entries = [entry.split() for entry in text.replace("\\\n", " ").splitlines()]
    return {
        entry[0].split("==")[0]: (
            entry[0].split("==")[1],
            sum(bool(re.fullmatch(r"--hash=sha256:[0-9a-f]{64}", part)) for part in entry[1:]),
        )
        for entry in entries
    }


def test_every_package_has_hashes_and_the_version_of_the_constraints() -> None:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pairs = [line.split("==") for line in lines if line and not line.startswith("#")]
    pinned = {canonicalize_name(name): version for name, version in pairs}
    for name, (version, hashes) in _locked().items():
        assert hashes, name
        if name != "setuptools":  # pip freeze leaves it out
            assert pinned[canonicalize_name(name)] == version, name


def test_all_that_palpate_needs_is_there_but_torch() -> None:
    locked, known, asked = _locked(), {"palpate", "torch"}, ["palpate", "torch"]
    while asked:
        name = asked.pop()
        for text in distribution(name).requires or []:
            need = Requirement(text)
            key = canonicalize_name(need.name)
            if (
                key.startswith(CUDA)
                or key in known
                or not (need.marker is None or need.marker.evaluate({"extra": ""}))
            ):
                continue
            assert key in locked, f"{key}, for {name}: run .ci/lock"
            known.add(key)
            asked.append(key)
    assert known - {"palpate", "torch"} == set(locked)
