"""Make docs/pictures/plot-*.png: figures of `flexcam plot` and other commands for the documentation."""

from __future__ import annotations

import shlex
import shutil
import tempfile
from contextlib import chdir
from pathlib import Path

from PIL import Image

from flexcam.cli.main import main

DOCS = Path(__file__).parent
CASES = ("pushrod-engine/intake.toml", "direct-acting/bucket.toml")
COLOURS = 200

COMMANDS = """
new exhaust-valve -o exhaust.toml
run intake.toml --set run.crank_speed=5900rpm -o results
sweep intake.toml --set run.crank_speed=4000:7000#13rpm --set springs.valve.stiffness=40:70:10kN/m --scalars springs
plot results/intake.vtkhdf --rigid -o plot-motion.png
plot bucket.toml exhaust.toml --over crank -o plot-crank.png
plot intake.toml --what map --channel contacts.intake.pressure --count 25 -o plot-map.png
plot intake.toml --what spring --channel springs.valve.force -o plot-spring.png
plot strong.toml --what goodman -o plot-goodman.png
campbell intake.toml --response --lowest 3000rpm --highest 7000rpm --count 21 --plot plot-orders.png
plot results/intake.sweep.h5 --y springs.valve.clearance.least --map -o plot-sweep.png
new direct-acting -o films.toml
plot films.toml --what orbits --set bearings.front={FRONT} --set bearings.rear={REAR} --set run.start=periodic -o plot-orbits.png
"""
FILM = 'film = { diameter = "26 mm", length = "15 mm", radial_clearance = "30 um", viscosity = "8 mPa s" }'
"""Bearing of docs/topics/journal-bearings.md."""
BEARINGS = {f"{{{name.upper()}}}": shlex.quote(f'{{ at = "{name}", {FILM} }}') for name in ("front", "rear")}
STRENGTH = '[materials.steel]\nultimate_strength = "900 MPa"\nendurance_limit = "350 MPa"\n'


def run_command(command: str) -> None:
    """Run a command of flexcam."""
    for placeholder, bearing in BEARINGS.items():
        command = command.replace(placeholder, bearing)
    try:
        main(shlex.split(command))
    except SystemExit as error:
        if error.code:
            raise


def make_pictures() -> None:
    """Run the commands in a temporary folder and store their pictures with few colours."""
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for case in CASES:
            shutil.copy(DOCS.parent / "cases" / case, Path(case).name)
        text = Path("intake.toml").read_text(encoding="utf-8")
        Path("strong.toml").write_text(text.replace("[materials.steel]\n", STRENGTH), encoding="utf-8")
        for command in COMMANDS.strip().splitlines():
            run_command(command)
        for picture in Path().glob("plot-*.png"):
            with Image.open(picture) as image:
                image.convert("RGB").quantize(COLOURS).save(DOCS / "pictures" / picture.name, optimize=True)


if __name__ == "__main__":
    make_pictures()
