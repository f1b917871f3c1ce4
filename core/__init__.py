"""The engine: from pictures to a panorama, without Blender. docs/layout.md draws its rooms."""
