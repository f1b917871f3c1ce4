"""The doors: the command line, the call from Python, and the worker process that Blender starts.

May import everything in core.
"""
