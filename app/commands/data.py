"""`palpate check`, `register` and `replay`."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from palpate.app.commands.console import (
    DatasetFolder,
    DatasetFolders,
    RegistrationOption,
    out,
    print_problem,
    print_warnings,
    progress,
)
from palpate.app.commands.mesh_report import print_mesh, print_mesh_errors
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import DatasetError, PalpateError, RegistrationError
from palpate.foundation.progress import part

if TYPE_CHECKING:
    from palpate.dataset import Dataset
    from palpate.dataset.check import DatasetSummary
    from palpate.mesh.box_mesh import BoxMesh
    from palpate.registration.registration import Registration
    from palpate.replay.equilibrium import Equilibrium
    from palpate.replay.mesh_convergence import MeshErrorEstimate

__all__ = ["check", "register", "replay"]

_NODES = (25, 9, 9)
"""Nodes whose motion is written where the mesh itself follows the tool."""


def check(
    datasets: DatasetFolders,
    picture: Annotated[
        Path | None, typer.Option(help="Write a picture of the touched places (one dataset only).")
    ] = None,
    digest: Annotated[
        bool,
        typer.Option(
            "--digest", help="Also print the digests: of samples, as in results, and of all bytes."
        ),
    ] = False,
) -> None:
    """Read everything in a dataset and print its content, warnings, and what it cannot show."""
    if picture is not None and len(datasets) != 1:
        raise DatasetError(
            f"--picture shows one dataset, {len(datasets)} were named; check them one by one"
        )
    broken = 0
    for path in datasets:
        try:
            _check_one(path, picture)
            if digest:
                _print_digests(path)
        except PalpateError as error:
            broken += 1
            print_problem(error, f" in {path}")
    if broken:
        raise typer.Exit(2)


def register(dataset: DatasetFolder) -> None:
    """Register robot, camera and phantom, each with its uncertainty."""
    from palpate.dataset import open_dataset
    from palpate.registration.registration import register as relate

    with progress("register") as report:
        registration = relate(open_dataset(dataset), report)
    table = Table(title=f"{dataset.name}: registration", header_style="bold")
    for column in ("", "translation", "rotation", "standard deviations"):
        table.add_column(column)
    table.add_row(
        "phantom from robot", *_pose(registration.phantom_from_robot, registration.robot_covariance)
    )
    table.add_row(
        "phantom from camera",
        *_pose(registration.phantom_from_camera, registration.camera_covariance),
    )
    out.print(table)
    if registration.robot is not None:
        out.print(registration.robot.summary, highlight=False)
    if registration.weak_directions:
        out.print(f"weakly determined: {', '.join(registration.weak_directions)}", highlight=False)
    print_warnings(registration.warnings)


def replay(
    dataset: DatasetFolder,
    sequence: Annotated[str, typer.Option(help="Name of the sequence.", show_default=False)],
    file: Annotated[
        Path,
        typer.Option(
            "--out", dir_okay=False, help="File of the frames (.npz).", show_default=False
        ),
    ],
    grid: Annotated[
        str, typer.Option(help="Even nodes along x, y, z, as in 13x5x5; or finest at the tool.")
    ] = "graded",
    registration: RegistrationOption = None,
    runs: Annotated[Path, typer.Option(help="Folder of the accepted registrations.")] = Path(
        "runs"
    ),
) -> None:
    """Simulate one sequence with the stated setup: one equilibrium per cloud, written to an .npz
    file.

    Frames without equilibrium are listed, marked in the file, and make the exit code 1.
    """
    import palpate.registration.registration as registering
    import palpate.replay.replay as simulation
    from palpate.app.storage.registration_store import accepted_for
    from palpate.dataset import open_dataset
    from palpate.dataset.provenance import made_from
    from palpate.mesh.box_mesh import GridSpec, box_mesh
    from palpate.mesh.default_meshes import Use, motion_mesh
    from palpate.replay.mesh_convergence import mesh_errors

    even = None if grid == "graded" else GridSpec.parse(grid)
    opened = open_dataset(dataset).registered(accepted_for(dataset, registration, runs))
    kinematics = opened.sequence(sequence).kinematics
    times = opened.sequence(sequence).cloud_times
    times = times if len(times) else kinematics.time
    with progress(f"replay {sequence}") as report:
        relation = registering.register(opened, part(report, 0.0, 0.1))
        setup = registering.setup_from(opened, relation)
        centres = setup.phantom_from_robot.apply(kinematics.position_at(times))
        spec = even or motion_mesh(Use.REPLAY, setup.geometry, setup.tool.radius, centres)
        frames = simulation.replay(setup, centres, spec, times=times, report=part(report, 0.1, 0.8))
        errors = mesh_errors(setup, frames, spec, report=part(report, 0.8, 1.0))
    surface = (
        _grid_surface(box_mesh(setup.geometry.size, even or GridSpec(nodes=_NODES)))
        if setup.geometry.is_block
        else (setup.surface().vertices, setup.surface().faces)
    )
    _save_frames(file, surface, times, centres, frames, errors, made_from(opened.path))
    failed = _failed(frames)
    where = f"{grid} nodes" if even else "a mesh that follows the tool"
    out.print(
        f"{len(frames)} frames on {where}, {len(frames) - len(failed)} converged: {file}",
        highlight=False,
    )
    print_mesh_errors(frames, errors)
    for number in failed:
        frame = frames[number]
        out.print(
            f"[yellow]frame {number}[/] {frame.outcome.value} (residual {frame.residual:.2g})",
            highlight=False,
        )
    if failed:
        raise typer.Exit(1)


def _grid_surface(mesh: BoxMesh) -> tuple[FloatArray, IntArray]:
    """Vertices (v, 3) [m] and quadrilaterals (q, 4) of a block's free surface."""
    used, quads = np.unique(mesh.free_surface, return_inverse=True)
    return mesh.nodes[used], quads.reshape(-1, 4)


def _save_frames(
    file: Path,
    surface: tuple[FloatArray, IntArray],
    times: FloatArray,
    centres: FloatArray,
    frames: Sequence[Equilibrium],
    errors: Sequence[MeshErrorEstimate],
    made: dict[str, Any],
) -> None:
    """Write the frames with a surface at rest (vertices, faces), and `made_from` as JSON."""
    rest, faces = surface
    _save(
        file,
        time=times,
        tool=centres,
        rest=rest,
        faces=faces,
        vertices=np.stack([frame.move(rest) for frame in frames]),
        force=np.stack([frame.force for frame in frames]),
        residual=np.array([frame.residual for frame in frames]),
        outcome=np.array([frame.outcome.name for frame in frames]),
        mesh_error=np.array(
            [(error.frame, error.displacement, error.relative, error.force) for error in errors]
        ).reshape(-1, 4),
        made_from=np.array(json.dumps(made)),
    )


def _failed(frames: Sequence[Equilibrium]) -> list[int]:
    """Indices of the frames without equilibrium."""
    from palpate.fem.newton import Outcome

    return [number for number, frame in enumerate(frames) if frame.outcome != Outcome.CONVERGED]


def _check_one(path: Path, picture: Path | None) -> None:
    from palpate.consistency import check_consistency
    from palpate.dataset import open_dataset
    from palpate.dataset.check import check_dataset
    from palpate.measurement.phantom_drift import align_sequences
    from palpate.registration.registration import register as relate

    dataset = open_dataset(path)
    registration: Registration | None = None
    with progress(f"check {path.name}") as report:
        dataset.validate(part(report, 0.0, 0.4))
        try:
            registration = relate(dataset, part(report, 0.4, 0.6))
            warnings = align_sequences(dataset, registration)[1].warnings
        except RegistrationError as error:
            warnings = (error.message,)
        warnings = (*warnings, *check_consistency(dataset, registration))
        summary = check_dataset(
            dataset,
            registration.phantom_from_robot if registration else None,
            part(report, 0.6, 1.0),
            was_read=True,
        )
    _print_summary(dataset, summary, registration)
    print_warnings((*summary.warnings, *warnings))
    if registration is not None and not dataset.geometry.is_block:
        print_mesh(dataset, registration)
    if picture is not None and registration is not None:
        from palpate.dataset.check.coverage_figure import coverage_picture

        coverage_picture(dataset, registration.phantom_from_robot, picture)
        out.print(f"coverage: {picture}", highlight=False)


def _print_digests(path: Path) -> None:
    from palpate.dataset.provenance import dataset_digest

    out.print(f"digest {dataset_digest(path)}, of all bytes {dataset_digest(path, full=True)}")


def _print_summary(
    dataset: Dataset, summary: DatasetSummary, registration: Registration | None
) -> None:
    title = f"{dataset.path.name} · {summary.name}"
    table = Table(
        title=title, header_style="bold", box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False
    )
    for column in ("sequence", "split", "length", "robot", "clouds", "lost", "points", "motion"):
        table.add_column(
            column,
            justify="left" if column in ("sequence", "split", "motion") else "right",
            no_wrap=column == "sequence",
        )
    for one in summary.sequences:
        table.add_row(
            one.name,
            one.split,
            f"{one.duration:.1f} s",
            f"{one.kinematics.rate:.0f} Hz",
            f"{one.clouds.count}, {one.clouds.rate:.1f} Hz" if one.clouds.count else "–",
            str(one.clouds.dropouts),
            "–" if one.points is None else str(one.points[1]),
            _motion(one.motion),
        )
    out.print(table)
    size = " × ".join(f"{1e3 * edge:.1f}" for edge in summary.size)
    touches = f"{len(summary.touches)} touches"
    if registration and registration.robot is not None:
        touches = (
            f"{touches}, {registration.robot.summary}"
            if summary.touches
            else (registration.robot.summary)
        )
    tool = f"tool radius {1e3 * summary.tool_radius:.1f} mm"
    out.print(f"phantom {size} mm, {tool}, {touches}", highlight=False)
    felt = [one for one in summary.sequences if one.forces]
    if felt:
        fitted = any(one.split in ("train", "validation") for one in felt)
        use = (
            "so that Young's modulus can be found"
            if fitted
            else "but in none to fit on, so that Young's modulus cannot be found"
        )
        out.print(
            f"forces in {len(felt)} of {len(summary.sequences)} sequences, {use}", highlight=False
        )
    for lack in summary.lacks:
        out.print(f"[yellow]lacks[/] {escape(lack.sentence)}", highlight=False)


def _motion(motion: Any) -> str:
    if motion is None:
        return "–"
    kinds = ", ".join(dict.fromkeys(contact.kind for contact in motion.contacts)) or "no contact"
    return f"{kinds}, {max(0.0, -1e3 * motion.nearest):.1f} mm"


def _pose(transform: Any, covariance: Any) -> tuple[str, str, str]:
    deviations = np.sqrt(np.diag(covariance))
    return (
        ", ".join(f"{1e3 * value:.2f}" for value in transform.translation) + " mm",
        f"{np.rad2deg(np.linalg.norm(transform.rotation_vector)):.2f}°",
        ", ".join(f"{1e3 * value:.2f}" for value in deviations[:3])
        + " mm; "
        + ", ".join(f"{np.rad2deg(value):.2f}" for value in deviations[3:])
        + "°",
    )


def _save(file: Path, **arrays: Any) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    aside = file.with_name(f".{file.name}.part")
    try:
        with aside.open("wb") as stream:
            np.savez(stream, **arrays)
        os.replace(aside, file)
    finally:
        aside.unlink(missing_ok=True)
