"""What is done to the pictures' light: exposure over all overlaps, vignetting, tone curves, light that is clipped.

The ways in: `exposure.exposures_for` for a pair, `graph_exposure` for more, before both `raw_highlights`. May
import what compose may.
"""
