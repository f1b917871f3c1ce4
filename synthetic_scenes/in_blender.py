"""What a Blender is told to run in a checkout: `blender -b --python in_blender.py -- validate …`, as `edf` has it.

The checkout need not be installed nor its extension be switched on: the command goes to a worker process, which takes
the libraries from the wheels of the extension that is installed.
"""

import importlib.util
import sys
from pathlib import Path

COMMAND = Path(__file__).absolute().parent.parent / "edf_addon" / "jobs" / "command.py"


def main(arguments: list[str]) -> int:
    """Exit status of a command. What starts the worker stands in one file that needs nothing of the package, so that
    file alone is loaded here."""
    spec = importlib.util.spec_from_file_location("edf_stitch.edf_addon.jobs.command", COMMAND)
    if spec is None or spec.loader is None:
        raise ImportError(f"{COMMAND} cannot be loaded")
    command = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(command)
    return int(command.run(arguments))


if __name__ == "__main__":
    sys.exit(main(sys.argv[sys.argv.index("--") + 1 :]))
