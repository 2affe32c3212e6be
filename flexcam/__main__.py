"""``python -m flexcam``, and the command ``flexcam``: an interrupt while the packages load ends without a traceback."""

import gc
import os

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables that the linear algebra reads when numpy loads: in small matrices threads only hinder each other."""


def start() -> None:
    """Load the command line and run it."""
    for name in _THREADS:
        os.environ.setdefault(name, "1")
    gc.disable()  # what is loaded stays: looking through it for garbage, now or at the end, is a tenth of a short run
    try:
        from flexcam.cli.main import main
    except KeyboardInterrupt:
        raise SystemExit(130) from None
    gc.freeze()
    gc.enable()
    main()


if __name__ == "__main__":
    start()
