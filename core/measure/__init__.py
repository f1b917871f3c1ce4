"""From a finished stitch to figures.

Method: docs/method.md, 9. May import every room before it.
"""
