"""From a finished stitch to files, and to what a window shows.

May import every room before it and the pipeline.
"""
