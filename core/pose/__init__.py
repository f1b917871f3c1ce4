"""From pictures to matches, and from matches to the relative pose and calibration of the cameras.

The way in: `features.detect`, `features.match` and `estimation.estimate`. Tuning values stand in `options`.

May import system, raster, pictures and cameras.
"""
