"""Many pairs and clips: the list, what each leaves on disk, the run.

May import the rooms before it but the rivals, and the pipeline.
"""
