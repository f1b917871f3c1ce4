"""Long work: from the settings to a job, the worker process that does it, and from its files into the Blender
file. Imports bridge; knows no operator and no panel.
"""
