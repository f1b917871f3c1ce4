"""Registration of rigs as no photographer takes them ends in finite cameras or in one sentence, and soon."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest
from edf_stitch.core.cameras.rig import Registration
from edf_stitch.core.rig.registration import register
from edf_stitch.core.system.errors import StitchError

from .hostile_rigs import HostileRig

RIGS = int(os.environ.get("EDF_SOAK_RIGS", 2000))
# CPU seconds that one may take.
SECONDS = 60.0


def sound(found: Registration, count: int) -> None:
    """What everybody may rely on."""
    rig = found.rig
    assert len(found.numbers) == len(rig.cameras) >= 2 and set(found.numbers) | set(found.left_out) == set(range(count))
    for array in (rig.R, rig.t, rig.rays, rig.inverse_ranges):
        assert np.isfinite(array).all()
    assert np.allclose(rig.R @ np.swapaxes(rig.R, 1, 2), np.eye(3), atol=1e-6)
    assert all(np.isfinite(camera.K).all() and camera.focal > 0 for camera in rig.cameras)
    assert all(len(why) > 10 and "\n" not in why for why in found.left_out.values())


def tried(numbers: range) -> int:
    """How many of these rigs were found."""
    count = 0
    for number in numbers:
        rig, began = HostileRig(number), time.process_time()
        try:
            found = register(rig.cameras, rig.points, rig.matches)
        except StitchError as error:
            assert len(str(error)) > 10 and "\n" not in str(error), (number, str(error))
        except Exception as error:
            raise AssertionError(f"rig {number}") from error
        else:
            sound(found, len(rig.points))
            count += 1
        assert time.process_time() - began < SECONDS, number
    return count


@pytest.mark.slow
def test_rigs_that_once_broke_it() -> None:
    """74: a step of the bundle that is not finite, which made NumPy warn."""
    tried(range(74, 75))


def test_hostile_rigs_are_found_or_refused() -> None:
    assert 0 < tried(range(12)) < 12


@pytest.mark.slow
@pytest.mark.soak
def test_many_hostile_rigs_are_found_or_refused() -> None:
    tried(range(12, 12 + RIGS))
