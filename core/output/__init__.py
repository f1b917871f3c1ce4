"""From a finished stitch to files, and to what a window shows.

May import the rooms before it but the rivals, and the pipeline.
"""
