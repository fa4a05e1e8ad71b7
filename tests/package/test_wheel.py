"""The wheel in a fresh environment, used in a folder with a core/ and an app/ of its own."""

from __future__ import annotations

import os
import site
import socket
import subprocess
import sys
import time
import urllib.request
import venv
from pathlib import Path

import pytest
from small_dataset import write_valid_dataset

pytestmark = pytest.mark.more

ROOT = Path(__file__).parents[2]
SCRIPT = """
import palpate as pp
import core, app
assert core.MINE and app.MINE
assert "site-packages" in pp.__file__, pp.__file__
data = pp.open_dataset("my-block")
experiment = pp.register(data)
replay = experiment.replay("poke-top-01", every=12)
assert replay.force.shape == (len(replay), 3)
print(pp.compare(replay).rms, abs(replay.force).max())
lump = pp.effects.StiffInclusion(x=0.0, y=0.0, z=0.02, radius=7e-3, stiffness_ratio=5.0)
stiff = experiment.with_effects(lump).replay("poke-top-01", every=12)
assert abs(stiff.force).max() > abs(replay.force).max()
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Python of an environment with the wheel, and the dependencies of this one."""
    place = tmp_path_factory.mktemp("wheel")
    _run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", place, ROOT)
    (wheel,) = place.glob("palpate-*.whl")
    venv.create(place / "env", with_pip=True)
    python = place / "env" / "bin" / "python"
    _run(python, "-m", "pip", "install", "--quiet", "--no-deps", wheel)
    (packages,) = (place / "env" / "lib").glob("python*/site-packages")
    # A path in a .pth file: the dependencies are found, this checkout's editable finder is not.
    (packages / "dependencies.pth").write_text("\n".join(site.getsitepackages()))
    return python


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user's folder with modules named like Palpate's source folders."""
    place = tmp_path_factory.mktemp("work")
    for name in ("core", "app"):
        (place / name).mkdir()
        (place / name / "__init__.py").write_text("MINE = True\n")
    write_valid_dataset(place / "small")
    return place


def test_wheel_carries_the_page_and_the_templates(installed: Path) -> None:
    text = _run(
        installed,
        "-c",
        "from importlib.resources import files; s = files('palpate.static'); "
        "print((s / 'index.html').is_file(), (s / 'css' / 'base.css').is_file())",
    )
    assert text.split() == ["True", "True"]


def test_science_runs_from_the_wheel(installed: Path, folder: Path) -> None:
    make = (
        "from pathlib import Path; from palpate.synthetic import Scenario, make_dataset\n"
        "if __name__ == '__main__':\n"
        "    names = ('poke-top-01', 'poke-top-02', 'poke-side-01')\n"
        "    make_dataset(Path('my-block'), Scenario(sequences=names, rate=10.0), seed=1)\n"
    )
    (folder / "make.py").write_text(make)
    (folder / "use.py").write_text(SCRIPT)
    _run(installed, "make.py", cwd=folder)
    rms, force = map(float, _run(installed, "use.py", cwd=folder).split())
    assert 0 < rms < 2e-3 and 0.01 < force < 10


def test_server_answers_from_the_wheel(installed: Path, folder: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [installed, "-m", "palpate.app.cli", "serve", "--port", str(port), "--datasets", "."]
    server = subprocess.Popen([*map(str, command), "--runs", "runs"], cwd=folder)
    try:
        page = _answer(f"http://127.0.0.1:{port}/")
        assert "palpate" in page.lower()
        assert "small" in _answer(f"http://127.0.0.1:{port}/api/datasets")
        assert "{" in _answer(f"http://127.0.0.1:{port}/static/css/base.css")
    finally:
        server.terminate()
        server.wait(30)


def test_import_of_the_old_names_says_what_to_write() -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import core"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1 and "write 'import palpate'" in done.stderr


def _answer(address: str, patience: float = 60.0) -> str:
    until = time.monotonic() + patience
    while True:
        try:
            with urllib.request.urlopen(address, timeout=10) as answer:
                return str(answer.read().decode())
        except OSError:
            if time.monotonic() > until:
                raise
            time.sleep(0.3)


def _run(*command: object, cwd: Path | None = None) -> str:
    known = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    known["PYPARDISO_MKL_RT"] = str(next(Path(sys.prefix, "lib").glob("libmkl_rt.so*"), ""))
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd or Path("/"),
        env=known,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
