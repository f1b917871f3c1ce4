"""Arrays and boxes, without any camera: from pixels to pixels.

May import system.
"""
