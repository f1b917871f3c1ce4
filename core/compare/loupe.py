"""A loupe for the page: all results of a pair or set at 1:1 around one place, where the pointer is in one of them."""

from __future__ import annotations

from typing import Any

LOUPE_STYLE = """
figure[data-loupe] { position: relative; }
figure[data-loupe] .glass { display: none; position: absolute; width: 260px; height: 200px; pointer-events: none;
  border: 2px solid var(--ink); border-radius: 6px; background-repeat: no-repeat; background-color: var(--soft);
  z-index: 2; }
figure[data-loupe] .glass.on { display: block; }
figure[data-loupe] .glass::after { content: ""; position: absolute; left: 50%; top: 50%; width: 7px; height: 7px;
  margin: -4px 0 0 -4px; border: 1px solid var(--bad); border-radius: 50%; }
"""

# data-loupe holds the px of the picture that show the reference's first, and px of the picture for one of the
# reference; or nothing: then places are shares of the picture's sides.
LOUPE_SCRIPT = """
(() => {
  "use strict";
  let shown = null;
  const inside = (img) => {
    const scale = Math.min(img.clientWidth / img.naturalWidth, img.clientHeight / img.naturalHeight);
    return { scale, x: (img.clientWidth - scale * img.naturalWidth) / 2,
             y: (img.clientHeight - scale * img.naturalHeight) / 2 };
  };
  const frame = (figure) => {
    const img = figure.querySelector("img"), told = figure.dataset.loupe.split(" ").map(Number);
    return told.length === 3 ? { kind: "px", x: told[0], y: told[1], w: told[2], h: told[2], img }
      : { kind: "share", x: 0, y: 0, w: img.naturalWidth, h: img.naturalHeight, img };
  };
  const show = () => {
    for (const glass of document.querySelectorAll(".glass.on")) glass.classList.remove("on");
    if (!shown) return;
    for (const figure of shown.section.querySelectorAll("figure[data-loupe]")) {
      const own = frame(figure), glass = figure.querySelector(".glass"), img = own.img;
      if (own.kind !== shown.kind || !img.naturalWidth) continue;
      const x = own.x + shown.x * own.w, y = own.y + shown.y * own.h, at = inside(img);
      glass.style.backgroundImage = `url("${img.src}")`;
      glass.style.backgroundPosition = `${130 - x}px ${100 - y}px`;
      glass.style.left = `${at.x + at.scale * x - 130}px`;
      glass.style.top = `${at.y + at.scale * y + 20}px`;
      glass.classList.add("on");
    }
  };
  for (const figure of document.querySelectorAll("figure[data-loupe]")) {
    const img = figure.querySelector("img");
    img.addEventListener("pointermove", (event) => {
      const own = frame(figure), at = inside(img);
      const x = (event.offsetX - at.x) / at.scale, y = (event.offsetY - at.y) / at.scale;
      shown = { section: figure.closest("section"), kind: own.kind, x: (x - own.x) / own.w, y: (y - own.y) / own.h,
                stepX: 1 / own.w, stepY: 1 / own.h };
      show();
    });
  }
  const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  document.addEventListener("keydown", (event) => {
    if (!shown) return;
    if (event.key === "Escape") { shown = null; show(); return; }
    const way = ways[event.key];
    if (!way) return;
    const step = event.shiftKey ? 10 : 1;
    shown.x += step * way[0] * shown.stepX;
    shown.y += step * way[1] * shown.stepY;
    show();
    event.preventDefault();
  });
})();
"""
LOUPE_NOTE = (
    "With the pointer in one of the panoramas, all show the same place at 1:1; arrow keys move it by a pixel, with "
    "Shift by ten; Escape puts it away."
)


def loupe_of(one: dict[str, Any], kind: str) -> str:
    """The attribute of a figure that a loupe is for; empty for kinds that have none."""
    if kind != "panorama":
        return ""
    origin = one.get("origin")
    told = "" if origin is None else " ".join(f"{float(value):.4f}" for value in origin)
    return f' data-loupe="{told}"'
