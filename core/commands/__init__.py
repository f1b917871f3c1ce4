"""The command line and the worker process that Blender starts.

May import everything in core.
"""
