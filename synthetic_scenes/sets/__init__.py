"""Sets of many pictures with known cameras, the true sphere at their viewpoint, and what a stitch of them is worth."""
