"""``python -m flexcam``, and the command ``flexcam``: an interrupt while the packages load ends without a traceback."""


def start() -> None:
    """Load the command line and run it.

    Raises
    ------
    SystemExit
        Always, with the exit code.
    """
    try:
        from flexcam.cli import main
    except KeyboardInterrupt:
        raise SystemExit(130) from None
    main()


if __name__ == "__main__":
    start()
