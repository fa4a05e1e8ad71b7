"""The text that names a mesh specification in samples, checkpoints and digests of stored results.

It is part of the format of these files: a training of an earlier version goes on, and its samples
are found again, only while the text stays the same. It therefore follows from the values alone, not
from the names of classes and fields.
"""

from __future__ import annotations

from palpate.mesh.box_mesh import GridSpec
from palpate.mesh.graded_mesh import Grading
from palpate.mesh.protocol import Meshing

__all__ = ["stored_label"]


def stored_label(spec: Meshing) -> str:
    """Return the text of a specification; its `repr` where no stored file depends on it."""
    if isinstance(spec, Grading):
        return (
            f"Grading(spacing={spec.spacing!r}, along={spec.along!r}, inward={spec.inward!r}, "
            f"longest={spec.longest!r}, order={spec.order!r})"
        )
    if isinstance(spec, GridSpec):
        return f"GridSpec(nodes={spec.nodes!r}, spacing={spec.spacing!r}, order={spec.order!r})"
    return repr(spec)
