"""Patches of which a group sees a small part."""

from __future__ import annotations

import numpy as np

from palpate.diagnosis.inference.noise.partly_seen import partly_seen


def test_patch_at_a_shadow_is_found_in_that_group_alone() -> None:
    count = np.full((4, 30), 20.0)
    count[2, 7] = 3
    assert np.argwhere(partly_seen(count)).tolist() == [[2, 7]]


def test_groups_of_fewer_clouds_and_smaller_patches_are_no_parts() -> None:
    count = np.outer([10.0, 2.0, 1.0], np.linspace(2.0, 20.0, 30))
    assert not partly_seen(count).any()


def test_unseen_patches_and_groups_are_no_parts() -> None:
    count = np.full((3, 5), 6.0)
    count[1], count[:, 2] = 0.0, 0.0
    assert not partly_seen(count).any()
