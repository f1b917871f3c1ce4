"""From a panorama that was decided at a fraction of its size to one of its full size, part by part.

The way in: `draft.Draft` and `enlarged.EnlargedPanorama`. May import what compose may.
"""
