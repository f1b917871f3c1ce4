"""What a stitch leaves in the 3D scene: cameras, a surface with depth, a World. From a panorama's geometry to numbers
(`scene_geometry`, without bpy) to objects (`take_along`). Imports bridge.
"""
