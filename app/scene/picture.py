"""One view of a run as figures to draw, in the phantom frame [m]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from palpate.app.drawing.figures import Figure, LinesFigure, SurfaceFigure, ToolFigure, checksum
from palpate.app.drawing.view import Quantity

__all__ = ["Picture"]


@dataclass(frozen=True, eq=False)
class Picture:
    """One view of a run.

    Attributes:
        frame: index in the sequence.
        figures: by name; a coloured surface is `MODEL-QUANTITY-07`, one figure for each colour.
        points: number of measured points.
        quantity: shown by the colours; None where nothing is coloured.
        limit: errors reach from -limit to limit [m], the other quantities from 0 to limit; None
            where nothing is coloured.
        columns: offset of each model (n, 3) [m].
    """

    frame: int
    figures: dict[str, Figure]
    points: int
    quantity: Quantity | None
    limit: float | None
    columns: tuple[tuple[float, float, float], ...]

    def of(self, kind: type[Any]) -> dict[str, Any]:
        """The figures of one type."""
        return {name: figure for name, figure in self.figures.items() if isinstance(figure, kind)}

    def scale(self) -> dict[str, Any]:
        """Quantity and limit of the colours."""
        return {"quantity": self.quantity, "limit": self.limit}

    def checksum(self) -> str:
        """A short digest of all arrays."""
        return checksum(self.frame, self.figures)

    def summary(self) -> dict[str, Any]:
        """Numbers of points, triangles and lines, and the digest."""
        tool = next(iter(self.of(ToolFigure).values()), None)
        return {
            "points": self.points,
            "triangles": {name: len(mesh.faces) for name, mesh in self.of(SurfaceFigure).items()},
            "lines": sum(
                len(lines.segments)
                for name, lines in self.of(LinesFigure).items()
                if name.endswith("-lines")
            ),
            "figures": sorted(self.figures),
            "tool": None if tool is None else [round(float(x), 6) for x in tool.centre],
            **self.scale(),
            "checksum": self.checksum(),
        }
