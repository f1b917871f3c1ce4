"""From pictures to matches, and from matches to the relative pose and calibration of the cameras.

The way in: `features.detect`, `features.match` and `estimation.estimate`. Tuning values stand in `options`.

Method: docs/method.md, 3. May import system, raster, pictures and cameras.
"""
