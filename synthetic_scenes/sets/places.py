"""Where things of the worlds are that recipes place cameras by; Blender reads it too, and has no library but NumPy."""

# x and y of the place that stray pictures show, m.
ELSEWHERE = (60.0, 0.0)
