"""What a Blender is told to run: `blender -b --python in_blender.py -- render …` or, from a checkout, `-- validate …`.

The package is loaded from the folder that this file lies in, whatever that folder's name, and without the extension
being switched on. `render` happens in this Blender; every other command goes to a worker, which takes the libraries
from the wheels of the installed extension.
"""

import importlib.util
import sys
from pathlib import Path

FOLDER = Path(__file__).absolute().parent.parent
NAME = "edf_stitch"


def load_package() -> None:
    """Makes FOLDER importable under the package's own name, in this Blender only."""
    file, search = FOLDER / "__init__.py", [str(FOLDER)]
    spec = importlib.util.spec_from_file_location(NAME, file, submodule_search_locations=search)
    if spec is None or spec.loader is None:
        raise ImportError(f"{FOLDER} holds no package")
    package = importlib.util.module_from_spec(spec)
    sys.modules[NAME] = package
    spec.loader.exec_module(package)


def main(arguments: list[str]) -> int:
    """Exit status of a command."""
    load_package()
    if arguments[:1] == ["render"]:
        importlib.import_module(f"{NAME}.synthetic_scenes.render").main(arguments[1:])
        return 0
    return int(importlib.import_module(f"{NAME}.edf_addon.jobs.command").run(arguments))


if __name__ == "__main__":
    sys.exit(main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []))
