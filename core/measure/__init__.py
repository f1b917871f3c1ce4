"""From a finished stitch to figures.

May import every room before it.
"""
