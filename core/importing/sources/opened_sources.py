"""Opening of whatever a user names: each format says itself whether it fits."""

from __future__ import annotations

from pathlib import Path

from palpate.foundation.errors import DatasetError
from palpate.importing.rules import ColumnRules
from palpate.importing.stream import Source

__all__ = ["is_source", "open_source"]


def is_source(folder: Path) -> bool:
    """Whether a folder is one recording by itself."""
    from palpate.importing.sources.bag_source import BagSource
    from palpate.importing.sources.cloud_folder_source import CloudFolderSource
    from palpate.importing.sources.depth_frames_source import DepthFramesSource

    return any(kind.fits(folder) for kind in (BagSource, CloudFolderSource, DepthFramesSource))


def open_source(path: Path, rules: ColumnRules | None = None) -> Source:
    """Open a file or folder of recorded data.

    Args:
        path: of the file or folder.
        rules: of its columns, where it is a table; None to propose them.

    Raises DatasetError where it does not exist, or where no format fits.
    """
    from palpate.importing.sources.bag_source import BagSource
    from palpate.importing.sources.cloud_folder_source import CloudFolderSource
    from palpate.importing.sources.depth_frames_source import DepthFramesSource
    from palpate.importing.sources.probing_source import ProbingSource
    from palpate.importing.sources.robot_frames_source import RobotFramesSource
    from palpate.importing.sources.table_source import TableSource

    if not path.exists():
        raise DatasetError(f"{path} does not exist; expected a recording", file=str(path))
    if BagSource.fits(path):
        return BagSource(path)
    if CloudFolderSource.fits(path):
        return CloudFolderSource(path)
    if DepthFramesSource.fits(path):
        return DepthFramesSource(path)
    if RobotFramesSource.fits(path):
        return RobotFramesSource(path)
    if TableSource.fits(path):
        table = TableSource(path, rules)
        if table.rules is not None and table.rules.rows == "depth-steps":
            return ProbingSource.of(table)
        return table
    raise DatasetError(
        f"{path.name} is no recording that is known; expected .bag, .db3, .mcap, a folder with "
        "metadata.yaml, a table (.csv, .tsv, .txt, .mat), or a folder of clouds named by stamps",
        file=path.name,
    )
