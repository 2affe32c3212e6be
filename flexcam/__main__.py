"""``python -m flexcam``, and the command ``flexcam``: an interrupt while the packages load ends without a traceback."""

import gc


def start() -> None:
    """Load the command line and run it."""
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
