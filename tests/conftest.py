"""Tiers and order of the tests, and a line on what is skipped without the shared datasets."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

# As the Makefile sets them, for tests that are run without it: before NumPy is imported.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

LONGEST = (
    "tests/loop",
    "tests/examples",
    "tests/core/synthetic/test_shape_dataset.py",
    "tests/core/blind",
    "tests/core/diagnosis",
    "tests/app",
)
"""These begin first, so that no worker ends with one of them while the others have nothing left."""

SECOND_TIER = (
    "tests/app/api/test_api_contract.py",
    "tests/app/api/test_correction.py",
    "tests/app/browser/test_jobs_browser.py",
    "tests/app/browser/test_login_browser.py",
    "tests/app/browser/test_register_browser.py",
    "tests/app/browser/test_scene_browser.py",
    "tests/app/browser/test_sweep_browser.py",
    "tests/app/browser/test_timeline_browser.py",
    "tests/app/browser/test_tutorial_browser.py",
    "tests/app/commands/test_sweep_command.py",
    "tests/app/jobs/test_job_survival.py",
    "tests/app/jobs/test_sweep_survival.py",
    "tests/app/jobs/test_whatif_process.py",
    "tests/app/legacy",
    "tests/core/blind/test_run_suite.py",
    "tests/core/correction/samples/test_sample_store.py",
    "tests/core/correction/test_online.py",
    "tests/core/correction/test_train.py",
    "tests/core/diagnosis/forward/test_history",
    "tests/core/diagnosis/inference/noise/test_camera_error_model.py::test_told_waves",
    "tests/core/diagnosis/inference/noise/test_camera_error_model.py::test_waves_are_told",
    "tests/core/diagnosis/inference/noise/test_rest_cloud.py::test_block_that_does_not_sag",
    "tests/core/diagnosis/inference/noise/test_rest_cloud.py::test_offset_of_depth",
    "tests/core/diagnosis/inference/noise/test_rest_cloud.py::test_rigid_motion",
    "tests/core/diagnosis/search/test_history_effects.py",
    "tests/core/diagnosis/search/test_outside_effects.py",
    "tests/core/evaluation",
    "tests/core/measurement/test_phantom_drift.py::test_a_block_that_slid",
    "tests/core/measurement/test_phantom_drift.py::test_only_the_slid",
    "tests/core/recording/test_resolve_frame.py",
    "tests/core/registration/camera/test_block_fit.py::test_camera_covariance",
    "tests/core/registration/test_registration.py::test_both_poses",
    "tests/core/registration/test_registration.py::test_wrong_pairings",
    "tests/core/replay/test_friction_step.py::test_failed_frame",
    "tests/core/replay/test_mesh_convergence.py",
    "tests/core/replay/test_replay_situations.py",
    "tests/core/sweep/test_run_sweep.py",
    "tests/core/synthetic/scenario/test_disturbance.py",
    "tests/core/synthetic/solver/test_agreement_with_replay.py",
    "tests/core/synthetic/solver/test_inelastic_history.py",
    "tests/core/synthetic/test_make_dataset.py",
    "tests/core/synthetic/test_registration_effects.py",
    "tests/loop",
)
"""Beginnings of test ids that `make test-more` runs: each takes more than some ten seconds, and the
default tier tests the same parts by lighter cases."""

SHARED = "no datasets "
"""Beginning of the reason for which tests of the shared datasets are skipped."""


def _place(item: pytest.Item) -> int:
    where = Path(item.path).relative_to(item.config.rootpath).as_posix()
    return next(
        (place for place, start in enumerate(LONGEST) if where.startswith(start)), len(LONGEST)
    )


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the second tier, and put the longest files first."""
    for item in items:
        if item.nodeid.startswith(SECOND_TIER):
            item.add_marker("more")
    items.sort(key=_place)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say in one line how many tests want the shared datasets."""
    missing = [
        report
        for report in terminalreporter.stats.get("skipped", [])
        if isinstance(report.longrepr, tuple) and SHARED in str(report.longrepr[2])
    ]
    if missing:
        terminalreporter.write_line(
            f"{len(missing)} tests were skipped: the datasets with truth are not there; "
            "PALPATE_DATASETS names their folder"
        )
