"""What people call the figures of sets: name, unit, digits after the point."""

SET_MEASURES = {
    "rotation_deg": ("rotation, median", "°", 3), "rotation_max_deg": ("rotation, worst", "°", 3),
    "position_mm": ("position, median", "mm", 1), "position_max_mm": ("position, worst", "mm", 1),
    "focal_percent": ("focal length, worst", "%", 2), "k1_error": ("k1, worst", "", 4),
    "principal_px": ("principal point, worst", "px", 2),
    "places": ("places that pictures are at", "", 0),
    "guessed_lengths": ("pairs whose distance is said to be guessed", "", 0),
    "overlap_px": ("map, what several see, median", "px", 2),
    "overlap_p90_px": ("map, what several see, 90th", "px", 2),
    "alone_px": ("map, what one sees, median", "px", 2), "alone_p90_px": ("map, what one sees, 90th", "px", 2),
    "hidden_px": ("map, what is hidden, median", "px", 2), "hidden_p90_px": ("map, what is hidden, 90th", "px", 2),
    "mapped": ("share of what is seen that maps show", "", 4),
    "hidden_precision": ("said to be hidden: precision", "", 3), "hidden_recall": ("said to be hidden: recall", "", 3),
    "range_log": ("range, median |ln|", "", 4), "range_log_p90": ("range, 90th |ln|", "", 3),
    "range_log_sure": ("range, median |ln| of the surer half", "", 4),
    "still_beside_px": ("beside the truth's rays, from one place, median", "px", 2),
    "still_beside_p95_px": ("beside the truth's rays, from one place, 95th", "px", 2),
    "slid_beside_px": ("beside the truth's rays, viewpoint slides, median", "px", 2),
    "slid_beside_p95_px": ("beside the truth's rays, viewpoint slides, 95th", "px", 2),
    "s1": ("how far the viewpoint slides", "", 2),
    "radiance_percent": ("merged exposures: radiance, over 12 stops, median", "%", 2),
    "radiance_stops": ("merged exposures: stops that are right to within 10 %", "", 0),
    "psnr_db": ("panorama against the true sphere, PSNR", "dB", 2),
    "ssim": ("panorama against the true sphere, SSIM", "", 4),
    "common_psnr_db": ("the same over what all of these show, PSNR", "dB", 2),
    "common_ssim": ("the same over what all of these show, SSIM", "", 4),
    "covered": ("share of what is seen that it shows", "", 3),
    "lines": ("straight edges of the world that it shows", "", 0), "uprights": ("uprights among them", "", 0),
    "line_px": ("straight edges, off straight in it, median", "px", 2),
    "line_p90_px": ("straight edges, off straight in it, 90th", "px", 2),
    "picture_line_px": ("straight edges, off straight by each map, median", "px", 2),
    "picture_line_p90_px": ("straight edges, off straight by each map, 90th", "px", 2),
    "upright_deg": ("uprights, lean, median", "°", 3), "upright_p90_deg": ("uprights, lean, 90th", "°", 3),
    "things": ("things that are seen", "", 0), "things_cut": ("things that are cut or doubled", "", 0),
    "things_half": ("worst thing, from being whole or gone", "", 3),
    "seam_levels": ("step of tone along borders, off the true one, median", "levels", 2),
    "seam_p90_levels": ("step of tone along borders, off the true one, 90th", "levels", 2),
}  # fmt: skip
# The same of one picture.
OF_A_PICTURE = SET_MEASURES | {"rotation_deg": ("rotation", "°", 3), "position_mm": ("position", "mm", 1)}
SET_PROOF_NAMES = {
    "direction_deg": "sphere's Position from its directions", "distance_relative": "ray casts against it, relative",
    "visibility_wrong": "visible by depth, not by rays: share", "visibility_asked": "rays that were asked",
    "sphere_psnr_db": "pictures by the true maps against the sphere: PSNR", "left_out": "pictures left out",
}  # fmt: skip
SET_PICTURES = {
    "sphere": "True sphere (dim: no picture sees it)", "panorama_ours": "Ours",
    "difference": "Difference of both × 4", "map_error": "Error of the maps: black 0, yellow ≥ 4 px",
    "panorama_rotation_only": "Ours as if taken from one place", "panorama_hugin": "Hugin",
    "panorama_opencv": "OpenCV's Stitcher",
    "from_above": "From above: true green, found pink",
}  # fmt: skip
