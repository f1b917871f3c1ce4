"""Command lines of `edf stitch` with random options, each of which follows from its number."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

from edf_stitch.core.choices import (
    BLENDS,
    CROPS,
    EXPOSURES,
    EXR_COMPRESSIONS,
    EXR_DEPTHS,
    FADES,
    FIELDS,
    HOLES,
    LEVELS,
    PROJECTIONS,
    SEAMS,
)

Chosen = Callable[[random.Random], list[str]]


def _of(option: str, *values: str) -> Chosen:
    return lambda chance: [f"{option}={chance.choice(values)}" if values else option]


# What may stand in a line; {folder} holds 1.png to 4.png, a mask for each, and cameras.json; {out} is to be filled.
OPTIONS: dict[str, Chosen] = {
    "field": _of("--field", "slack", "strict", *FIELDS), "fade": _of("--fade", *FADES),
    "dense": _of("--no-dense"), "slide": _of("--slide", "0", "1", "0.37", "auto", "7"),
    "projection": _of("--projection", *PROJECTIONS, "pannini:0", "pannini:1", "pannini:9"),
    "level": _of("--level", *LEVELS, "10,0,0", "0,-80,5", "170,89,179", "1"), "centre": _of("--centre", "5,3", "90,80"),
    "fov": _of("--fov", "1", "40", "110", "359", "0"), "blend": _of("--blend", *BLENDS), "seam": _of("--seam", *SEAMS),
    "exposure": _of("--exposure", *EXPOSURES, "-1", "9", "11"), "holes": _of("--holes", *HOLES),
    "crop": _of("--crop", *CROPS, "0,0,1,1", "5,5,60,40", "-5,0,9,9", "0,0,99999,9"),
    "scale": _of("--scale", "0.5", "0.02", "0.9", "2"), "seed": _of("--seed", "0", "1", "-1", "99999999999"),
    "preview": _of("--preview"), "brackets": _of("--brackets", "off", "auto", "2"),
    "focal": _of("--focal-px", "260", "200,900", "1", "1e6"), "principal": _of("--principal", "150,110", "-900,4000"),
    "focal35": _of("--focal35", "28", "5"), "cameras": _of("--cameras", "{folder}/cameras.json"),
    "viewpoint": _of("--viewpoint", "2", "centre", "1.png", "9"), "all": _of("--require-all"),
    "metres": _of("--scale-metres", "1,2,0.5", "1.png,2.png,1e-9", "1,1,2"),
    "ignore": _of("--ignore", "1.png={folder}/mask.png", "2={folder}/mask.png", "x={folder}/mask.png"),
    "ignore_ref": _of("--ignore-ref", "{folder}/mask.png"), "show": _of("--show", "2.png={folder}/mask.png"),
    "mask": _of("--mask", "{folder}/mask.png"), "vertical": _of("--vertical", "1.png=20,10,22,200", "1=0,0,0,0"),
    "horizontal": _of("--horizontal", "2.png=10,100,300,101"), "memory": _of("--memory", "0.3", "8", "1e-9"),
    "layers": _of("--layers", "{out}/layers"), "warp": _of("--warp", "{out}/w.npz"),
    "report": _of("--report", "{out}/r.json"), "depth": _of("--depth", "{out}/d.exr"),
    "mesh": _of("--mesh", "{out}/m.glb"), "exr": _of("--exr-depth", *EXR_DEPTHS),
    "packed": _of("--exr-compression", *EXR_COMPRESSIONS), "json": _of("--json"), "verbose": _of("--verbose"),
    "cameras_out": _of(
        "--cameras-out", "{out}/c.json", "{out}/c.pto", "{out}/c.chan", "{out}/transforms.json", "{out}/colmap"
    ),
}  # fmt: skip


def random_words(number: int, folder: Path, out: Path) -> list[str]:
    """A command line: two to four pictures, up to seven options, most of them without contradictions."""
    chance = random.Random(number)
    pictures = [str(folder / f"{one}.png") for one in range(1, chance.choice((2, 2, 2, 3, 4)) + 1)]
    chosen = chance.sample(sorted(OPTIONS), chance.randint(1, 7))
    words = [word for name in chosen for word in OPTIONS[name](chance)]
    if "dense" not in chosen and chance.random() < 0.5:  # it takes most of the time
        words.append("--no-dense")
    target = out / f"o{chance.choice(('.png', '.png', '.jpg', '.tif', '.exr', '.hdr'))}"
    words = [word.replace("{folder}", str(folder)).replace("{out}", str(out)) for word in words]
    return ["stitch", *pictures, "-o", str(target), "--no-cache", *words]
