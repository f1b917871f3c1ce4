"""`python -m edf_stitch …`: the same command as the console script, and what Blender's worker process runs."""

import os
import sys

# Before anything loads NumPy: BLAS gives other bytes with other thread counts, and the same input owes the same bytes.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

if __name__ == "__main__":
    from .core.commands.cli import main

    sys.exit(main())
