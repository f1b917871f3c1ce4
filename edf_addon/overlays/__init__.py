"""What is drawn over the pictures in the Image Editor. From a panorama's geometry and the list of matches to points
and colours (`overlay_geometry`, without bpy), and those onto the screen (`drawing`). Imports bridge and scene.
"""
