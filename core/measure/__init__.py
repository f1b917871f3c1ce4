"""From a finished stitch to figures.

Method: docs/method.md, 9. May import the rooms before it but the rivals.
"""
