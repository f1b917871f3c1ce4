"""The panorama's depth as other programs read it: from a finished stitch to an image of ranges (EXR) and a mesh (glTF).

Imports what `output` may. `surface` knows arrays only: Blender's depth mesh is made by it too.
"""
