"""What the recipes of sets and their rendering share; Blender reads it too, and has no library but NumPy."""

# x and y of the place that stray pictures show, m.
ELSEWHERE = (60.0, 0.0)


def shown_name(name: str, exposure: float) -> str:
    """The file of a picture that is so much brighter exposed, EV."""
    return f"{name}.png" if not exposure else f"{name}_{exposure:+g}ev.png"
