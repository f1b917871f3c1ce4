"""How well intrinsics are known, with units and why the values are what they are."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class IntrinsicsOptions:
    """Priors of focal length and principal point (`sources`). Deviations of focal lengths are those of log f."""

    # σ by EXIF: phone makers round, and measure before distortion is corrected; 2 to 7 % off were seen.
    exif_sigma: float = 0.05
    # σ by EXIF of a picture that was cropped since, or by the other picture.
    cropped_sigma: float = 0.2
    # σ of an assumed focal length: lenses from wide to short telephoto lie within two.
    assumed_sigma: float = 0.4
    # Assumed focal length in units of the longer side: 32 mm on a frame 36 mm wide.
    assumed_focal: float = 0.9
    # Focal lengths by EXIF outside of these, in units of the longer side, are nonsense.
    least_focal: float = 0.2
    most_focal: float = 50.0
    # Difference of log f from which two statements of EXIF contradict each other.
    contradiction: float = 0.15
    # Difference of the log of the aspect ratio from which a picture was cropped since it was taken.
    cropped_aspect: float = 0.03
    # Difference of the log of diagonals within which a sensor is one of those that there are.
    same_sensor: float = 0.08
    # σ of the principal point in units of the longer side: the axis does not meet the sensor in its middle.
    principal_sigma: float = 0.01
    # Degrees that a fisheye's circle is taken to show: most are built for 180, from 170 to 190 are sold.
    circle_deg: float = 180.0


@dataclass(frozen=True)
class LensOptions:
    """Undistortion and how far a distortion polynomial is trusted (`lens`)."""

    # Least slope of the raw radius by the ideal one where the polynomial is trusted: 0 is where it folds back.
    least_slope: float = 0.5
    # Raw radius up to which it is trusted, in units of the farthest corner's: a little beyond the picture.
    reach: float = 1.2
    # Samples of the radius among which the limit is sought.
    radius_samples: int = 1200
    # Iterations of undistortion, at most, and the step in normalised units that ends them.
    iterations: int = 60
    tolerance: float = 1e-12
    # Step of an angle, rad, that ends its search: what is left then is its square.
    angle_tolerance: float = 1e-9
    # Angles from the axis, degrees, up to which models are looked at: tangents and sines end at 90, the others at 180.
    widest_flat: float = 89.9
    widest_round: float = 179.0
    # Focal lengths per rad below which a lens shows too little to be inverted; 0 is where it folds.
    least_angular_slope: float = 0.05
    # Degrees from the axis up to which a picture is used: the engine holds pictures on their planes, where what is
    # shown at 80 is stretched 6 × across and 33 × outwards.
    widest_used: float = 80.0


@dataclass(frozen=True)
class PlausibleOptions:
    """Intrinsics beyond which something else was given than a camera's (`plausible`)."""

    # Focal length in units of the longer side: a 6 mm fisheye has 0.17 on full frame, a 1200 mm lens 33 there and 200
    # on the smallest sensors; some room is left for pictures that were cropped.
    least_focal: float = 0.1
    most_focal: float = 500.0
    # Ratio of the two focal lengths of K: pixels of anamorphic pictures are twice as wide as high.
    most_aspect: float = 3.0
    # Distance of the principal point from the middle, in units of the longer side: of a corner that was cut out of a
    # larger picture it lies far outside.
    principal_reach: float = 20.0


INTRINSICS = IntrinsicsOptions()
PLAUSIBLE = PlausibleOptions()
LENS = LensOptions()
