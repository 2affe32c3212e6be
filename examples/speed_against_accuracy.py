"""
Speed against accuracy
======================

Errors of simpler models of the published mechanism, relative to a converged run: rigid members, one mass, a chain of
masses, few modes and all beams, at several steps. Squares mark the models on the Pareto front of work and error.
"""

import flexcam
from flexcam.analysis.model_choice import evaluate_ladder
from flexcam.plotting.histories import work_precision_figure

case = flexcam.read_case("../cases/tayeb/model-3-shm.toml", ["run.revolutions=1"])
reference, models = evaluate_ladder(case, "valve", repeats=1)
figure = work_precision_figure(models)

# %%
# Three masses are as accurate as the beams with an eighth of the unknowns. One mass has an error of about 0.1 %, the
# rigid train one of about 17 %.
finest = {model.rung: model for model in sorted(models, key=lambda model: model.steps)}
for name, model in finest.items():
    print(f"{name:9s} {model.unknowns:3d} unknowns: error {model.errors['lift']:.1e} of the lift")
assert finest["rigid"].errors["lift"] > 0.1 > 2e-3 > finest["sdof"].errors["lift"]
assert finest["chain 3"].errors["lift"] < 1e-6
assert 8 * finest["chain 3"].unknowns == finest["beams"].unknowns
assert reference.errors["lift"] < 1e-5 * reference.size["lift"]
