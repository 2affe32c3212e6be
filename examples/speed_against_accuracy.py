"""
Speed against accuracy
======================

Every cheaper model of the published mechanism against a converged run: rigid members, one mass, a chain of masses,
few modes, all beams, at several steps. Squares mark the models that no other beats both in work and in error.
"""

import flexcam
from flexcam.analysis.model_choice import evaluate_ladder
from flexcam.plotting.histories import work_precision_figure

case = flexcam.read_case("../cases/tayeb/model-3-shm.toml", ["run.revolutions=1"])
reference, models = evaluate_ladder(case, "valve", repeats=1)
figure = work_precision_figure(models)

# %%
# Three masses do what the beams do, at an eighth of the unknowns; one mass is a thousandth off, the rigid train a
# sixth.
finest = {one.rung: one for one in sorted(models, key=lambda one: one.steps)}
for name, one in finest.items():
    print(f"{name:9s} {one.unknowns:3d} unknowns: the lift is {one.errors['lift']:.1e} off")
assert finest["rigid"].errors["lift"] > 0.1 > 2e-3 > finest["sdof"].errors["lift"]
assert finest["chain 3"].errors["lift"] < 1e-6
assert 8 * finest["chain 3"].unknowns == finest["beams"].unknowns
assert reference.errors["lift"] < 1e-5 * reference.size["lift"]
