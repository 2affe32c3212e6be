"""Write the meshes of the published models into this folder: ``python meshes/generate.py``."""

from pathlib import Path

from flexcam.fem.mesh import published_model
from flexcam.io import write_mesh

if __name__ == "__main__":
    for model in (1, 2, 3):
        target = Path(__file__).with_name(f"tayeb-{model}.msh")
        target.unlink(missing_ok=True)
        write_mesh(published_model(model), target)
