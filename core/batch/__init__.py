"""Many pairs and clips: the list, what each leaves on disk, the run.

May import every room before it and the pipeline.
"""
