"""What an artist can do: one operator for each button, thin over the rooms that do it. Imports bridge, jobs, scene and
overlays; knows no panel.
"""
