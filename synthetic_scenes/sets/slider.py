"""Two pictures of the same size, one over the other, with a slider that says how much of which is shown."""

from __future__ import annotations

from html import escape

STYLE = """
.slider { position: relative; margin: 0.8rem 0; --at: 50%; }
.slider img { aspect-ratio: auto; border-radius: 0; }
.slider .over { position: absolute; left: 0; top: 0; clip-path: inset(0 0 0 var(--at)); }
.slider .edge { position: absolute; left: var(--at); top: 0; bottom: 2.6rem; width: 2px; background: #fff; }
.slider input { display: block; width: 100%; height: 1.2rem; margin: 0.2rem 0 0; cursor: ew-resize; }
.slider p { display: flex; justify-content: space-between; max-width: none; height: 1.2rem; margin: 0; }
"""
MOVE = "this.parentNode.style.setProperty('--at', this.value + '%')"


def slider(left: tuple[str, str], right: tuple[str, str]) -> str:
    """The slider of two pictures, each its address and what it shows; the right one lies above."""
    (under, under_says), (over, over_says) = ((escape(path), escape(text)) for path, text in (left, right))
    return (
        f'<div class="slider"><img src="{under}" alt="{under_says}"><img class="over" src="{over}" alt="{over_says}">'
        f'<span class="edge"></span><input type="range" min="0" max="100" value="50" step="0.1" '
        f'aria-label="{under_says} up to here, then {over_says}" oninput="{MOVE}">'
        f'<p class="quiet"><span>{under_says}</span><span>{over_says}</span></p></div>'
    )
