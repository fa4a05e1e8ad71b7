"""`palpate surface`: a body's surface from CT or a scanner, shown and on request repaired."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from palpate.app.commands.console import out, print_problem, progress
from palpate.foundation.errors import MeshError
from palpate.foundation.progress import part

if TYPE_CHECKING:
    from palpate.setup.surface_repair.repair_surface import RepairRecord
    from palpate.setup.surface_repair.surface_summary import SurfaceSummary
    from palpate.setup.surface_repair.triangle_surface import RepairStep, TriangleSurface

__all__ = ["surface"]


def surface(
    file: Annotated[Path, typer.Argument(help="An STL, PLY or OBJ.", show_default=False)],
    unit: Annotated[str, typer.Option(help="Unit of the file: m, cm or mm.")] = "m",
    up: Annotated[
        str | None, typer.Option(help="Direction of the file that is up: y, -z, or 0,0.1,1.")
    ] = None,
    clean: Annotated[
        bool, typer.Option("--clean", help="Merge vertices, remove doubled and flat triangles.")
    ] = False,
    merge: Annotated[
        float, typer.Option(metavar="MM", min=0.0, max=10.0, help="What --clean merges.")
    ] = 1e-3,
    body: Annotated[
        int | None, typer.Option(min=1, help="Keep one body: 1 is the largest.")
    ] = None,
    orient: Annotated[bool, typer.Option("--orient", help="Turn all triangles outwards.")] = False,
    close_base: Annotated[
        bool, typer.Option("--close-base", help="Close the base by a plane.")
    ] = False,
    base_height: Annotated[
        float | None,
        typer.Option(
            metavar="MM",
            min=0.0,
            max=1e4,
            help="Height of this plane over the lowest point, below which the body is cut off; "
            "0 if not stated.",
        ),
    ] = None,
    fill_holes: Annotated[
        float | None,
        typer.Option(metavar="MM", min=1e-6, max=1e4, help="Close holes up to this width."),
    ] = None,
    rebuild: Annotated[
        float | None,
        typer.Option(
            metavar="MM",
            min=1e-3,
            max=1e3,
            help="Draw the surface anew on a grid of this size, which resolves crossings and inner "
            "walls.",
        ),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            metavar="MM", min=1e-6, max=1e3, help="Decimate as far as this deviation allows."
        ),
    ] = None,
    on_table: Annotated[
        bool, typer.Option("--on-table", help="Move the lowest point to z = 0.")
    ] = False,
    target: Annotated[
        Path | None,
        typer.Option("--out", dir_okay=False, help="Write the repaired surface: STL, metres."),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace the file of --out.")
    ] = False,
    picture: Annotated[
        Path | None, typer.Option(dir_okay=False, help="Write a PNG of before and after.")
    ] = None,
) -> None:
    """Show what a surface holds, repair it by the options that are named, and write a closed one.

    Without options nothing is changed. Each step says what it did and how far the new surface lies
    from the one before, in mm. A surface that no dataset could use is not written.
    """
    from palpate.setup.surface_repair.repair_surface import UNITS, load_surface, repair, rounded
    from palpate.setup.surface_repair.surface_deviation import surface_deviation
    from palpate.setup.surface_repair.surface_summary import summarize

    if unit not in UNITS:
        raise MeshError(f"--unit is {unit!r}; expected one of {', '.join(UNITS)}", unit=unit)
    steps = _steps(
        up, merge if clean else None, body, orient, (close_base, base_height), fill_holes,
        rebuild, tolerance, on_table,
    )  # fmt: skip
    _check_target(file, target, overwrite, bool(steps))
    with progress(f"surface {file.name}") as report:
        report(0.0, "reading")
        read, repeated = load_surface(file, unit)
        report(0.1, "counting")
        before = summarize(read, repeated)
        made, records = repair(read, steps, part(report, 0.3, 0.8))
        made = rounded(made) if steps else made
        after = summarize(made) if steps else None
        whole = surface_deviation(read, made) if steps and not (up or on_table) else None
        if picture is not None:
            from palpate.app.drawing.surface_picture import surface_picture

            report(0.9, "drawing")
            surface_picture(read, made if steps else None, picture)
    _print_summary(f"{file.name}, read in {unit}", before, after)
    if records:
        _print_steps(records)
    if whole is not None:
        new, old = _millimetres(whole.new_largest), _millimetres(whole.old_largest)
        out.print(
            f"in all the new surface deviates by {new} mm at most from the old one, the old one by "
            f"{old} mm from it",
            highlight=False,
        )
    if picture is not None:
        out.print(f"picture: {picture}", highlight=False)
    _finish(made, after or before, target)


def _steps(
    up: str | None,
    merge: float | None,
    body: int | None,
    orient: bool,
    base: tuple[bool, float | None],
    fill_holes: float | None,
    rebuild: float | None,
    tolerance: float | None,
    on_table: bool,
) -> list[RepairStep]:
    """The steps that were asked for, in their order; lengths [mm]."""
    from palpate.setup.surface_repair.cleaning import Clean, KeepBody
    from palpate.setup.surface_repair.closing import CloseBase, FillHoles
    from palpate.setup.surface_repair.decimation import Decimate
    from palpate.setup.surface_repair.placing import Orient, PutOnTable, TurnUp
    from palpate.setup.surface_repair.rebuilding import Rebuild

    steps: list[RepairStep | None] = [
        None if up is None else TurnUp(up),
        None if merge is None else Clean(1e-3 * merge),
        None if body is None else KeepBody(body),
        Orient() if orient else None,
        CloseBase(1e-3 * (base[1] or 0.0)) if base[0] or base[1] is not None else None,
        None if fill_holes is None else FillHoles(1e-3 * fill_holes),
        None if rebuild is None else Rebuild(1e-3 * rebuild),
        # A body that was open has an outside only when it is closed.
        Orient() if orient and (base[0] or base[1] is not None or fill_holes) else None,
        None if tolerance is None else Decimate(1e-3 * tolerance),
        PutOnTable() if on_table else None,
    ]
    return [step for step in steps if step is not None]


def _check_target(file: Path, target: Path | None, overwrite: bool, changed: bool) -> None:
    """Refuse to write what nobody asked for."""
    if target is None:
        return
    if target.suffix.lower() != ".stl":
        raise MeshError(
            f"{target.name}: a repaired surface is written as STL; name it "
            f"{target.with_suffix('.stl').name}",
            file=str(target),
        )
    if target.exists() and not overwrite:
        raise MeshError(
            f"{target}: is there already; name another file, or add --overwrite", file=str(target)
        )
    if not target.parent.is_dir():
        raise MeshError(f"{target.parent}: is no folder; make it first", file=str(target.parent))


def _print_summary(title: str, before: SurfaceSummary, after: SurfaceSummary | None) -> None:
    table = Table(title=title, header_style="bold", box=SIMPLE, pad_edge=False)
    table.add_column("")
    for name in ("before", "after")[: 1 if after is None else 2]:
        table.add_column(name, justify="right")
    columns = [_values(before)] if after is None else [_values(before), _values(after)]
    for name in columns[0]:
        table.add_row(escape(name), *(column[name] for column in columns))
    out.print(table)


def _values(found: SurfaceSummary) -> dict[str, str]:
    size = " x ".join(_millimetres(length) for length in found.high - found.low)
    low = ", ".join(_millimetres(value) for value in found.low)
    volume = f"{1e6 * found.volume:.4g}" + ("" if found.is_closed else " (open)")
    return {
        "triangles": str(found.triangles),
        "vertices": str(found.vertices),
        "doubled vertices, merged": str(found.repeated_vertices),
        "doubled triangles": str(found.doubled),
        "triangles without an area": str(found.collapsed),
        "slivers": str(found.slivers),
        "open edges": str(found.open_edges),
        "holes": str(found.holes),
        "edges of more than two triangles": str(found.shared_edges),
        "bodies": str(found.bodies),
        "orientation": found.orientation,
        "crossing pairs of triangles": str(found.crossings),
        "volume [cm3]": volume,
        "extent along x, y, z [mm]": size,
        "lowest x, y, z [mm]": low,
    }


def _print_steps(records: list[RepairRecord]) -> None:
    table = Table(header_style="bold", box=SIMPLE, pad_edge=False)
    table.add_column("step")
    table.add_column("what it did", overflow="fold")
    for name in ("new from old [mm]", "old from new [mm]"):
        table.add_column(f"{escape(name)}\nlargest, RMS", justify="right")
    for record in records:
        apart = record.deviation
        cells = (record.unmoved, "") if apart is None else (
            f"{_millimetres(apart.new_largest)}, {_millimetres(apart.new_rms)}",
            f"{_millimetres(apart.old_largest)}, {_millimetres(apart.old_rms)}",
        )  # fmt: skip
        table.add_row(record.title, escape(record.said), *cells)
    out.print(table)


def _finish(made: TriangleSurface, found: SurfaceSummary, target: Path | None) -> None:
    """Say whether a dataset could use the surface, and write it where it could."""
    from palpate.setup.free_form.surface_file import check_surface
    from palpate.setup.surface_repair.repair_surface import remedies, write_stl

    try:
        check_surface(made.name, made.vertices, made.triangles)
    except MeshError as error:
        print_problem(error)
        if hints := remedies(found):
            out.print(f"to mend it add: [bold]{' '.join(hints)}[/]", highlight=False)
        if target is not None:
            out.print(f"{target} was not written", highlight=False)
        raise typer.Exit(2 if target is not None else 1) from None
    if target is None:
        out.print("closed, one body, outwards, without crossings", highlight=False)
        return
    write_stl(made, target)
    out.print(f"{target}: {len(made.triangles)} triangles, metres", highlight=False)


def _millimetres(length: float) -> str:
    return f"{1e3 * length + 0.0:.3g}"
