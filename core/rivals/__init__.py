"""What EDF Stitch is measured against, written from the papers: the same matches in, the same kind of map out.

A rival knows no depth and no epipolar lines: its inverse depth, F, R, t are NaN, its e' is 0, and its H_inf is the one
homography that it starts from. What `--fade` says does not concern it: each ends beyond the overlap as its paper says.
"""
