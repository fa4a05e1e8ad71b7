"""First-order change by friction under the tool, from the plain replay alone.

The contact is one spot that sticks to the tool until the pull exceeds what friction holds. The
compliance of the spot follows from the frame's own factor: tractions are spread over the contact
like its pressure, with one linear solve for each direction. Pull and hold are integrated along the
tool's path between the groups (see `palpate.diagnosis.forward.loading_history`). The hold is
proportional to the power of the depth that Hertz gives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.forward.loading_history import LoadingHistory
from palpate.fem.model import CONTACT_STIFFNESS, BlockModel
from palpate.foundation.arrays import FloatArray
from palpate.gradients.frame_tangent import local_tool
from palpate.replay.friction_step import contact_depth, points_from_tool
from palpate.replay.replay import Equilibrium

__all__ = ["ContactSpot", "pulls", "spot_of"]


@dataclass(frozen=True, eq=False)
class ContactSpot:
    """The contact of one group.

    Attributes:
        answer: displacement of the unknowns (u, 3) under a pull of one over E along each axis
            [1/m].
        gives: motion of the spot under it (3, 3) [1/m].
        normal: unit vector (3,) from the tool's centre.
        held: normal force over E [m^2].
    """

    answer: FloatArray
    gives: FloatArray
    normal: FloatArray
    held: float


def spot_of(model: BlockModel, frame: Equilibrium) -> ContactSpot | None:
    """Return the contact of a frame whose tangent is factorised; None without a force."""
    positions, probe = frame.mesh.nodes + frame.displacement, local_tool(frame)
    seen = points_from_tool(model, positions, probe)
    pushes = CONTACT_STIFFNESS * model.areas * contact_depth(model, positions, probe)
    held = float(pushes.sum())
    faces = np.flatnonzero(pushes.any(axis=1))
    if held <= 0.0 or not len(faces):
        return None
    shares, here = pushes[faces] / held, seen[faces]
    normals = here / np.linalg.norm(here, axis=2, keepdims=True)
    along = np.eye(3) - normals[..., :, None] * normals[..., None, :]
    loads = np.einsum("fq,qa,fqij->faij", shares, model.face.shapes, along)
    spread = np.zeros((len(positions), 3, 3))
    np.add.at(spread, model.topology.surface[faces], loads)
    pull = spread[model.topology.free]
    answer = model.topology.factor.solve(pull)
    normal = np.einsum("fq,fqi->i", shares, normals)
    return ContactSpot(answer, pull.T @ answer, normal / np.linalg.norm(normal), held)


def pulls(
    friction_coefficient: float, time: LoadingHistory, spots: Sequence[ContactSpot | None]
) -> FloatArray:
    """Return the drag on the block over E (k, 3) [m^2] at each of the groups in contact.

    Args:
        friction_coefficient: of the tool [1].
        time: what lies between the groups.
        spots: contact of each of these groups; None where no force is seen.
    """
    found = np.zeros((len(spots), 3))
    usable = [number for number, spot in enumerate(spots) if spot is not None]
    if not usable:
        return found
    stiff = {
        number: np.linalg.pinv(_required(spots[number]).gives, rcond=0.05) for number in usable
    }
    instants = np.array([time.instants[group] for group in time.touched])
    upcoming = np.searchsorted(time.times, instants)
    drag, last = np.zeros(3), time.places[0]
    for row, (place, shares) in enumerate(zip(time.places, time.shares, strict=True)):
        moved, last = place - last, place
        nearest = max(usable, key=lambda number: shares[number])
        if shares[nearest] <= 0.0:
            drag = np.zeros(3)
        else:
            spot = _required(spots[nearest])
            moved = moved - spot.normal * (moved @ spot.normal)
            drag = drag + stiff[nearest] @ moved
            drag -= spot.normal * (drag @ spot.normal)
            hold = (
                sum(shares[number] * _required(spots[number]).held ** (2 / 3) for number in usable)
                ** 1.5
            )
            drag *= min(1.0, friction_coefficient * hold / max(float(np.linalg.norm(drag)), 1e-300))
        for number in np.flatnonzero(upcoming == row):
            found[number] = drag
    return found


def _required(spot: ContactSpot | None) -> ContactSpot:
    assert spot is not None
    return spot
