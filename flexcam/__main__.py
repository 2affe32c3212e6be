"""``python -m flexcam``."""

from flexcam.cli import main

if __name__ == "__main__":
    main()
