"""Tables and words of every command; `commands` prints what these functions return.

A new table is a function in the file of its kind.
"""

from flexcam.cams import CamFacts
from flexcam.console.cams import cam_json, cam_table, overlap_table, read_table, smoothing_table
from flexcam.console.cases import (
    claim_table,
    comparison_json,
    comparison_table,
    comparison_words,
    couplings,
    left_out,
    mac_table,
    mode_table,
    model_table,
    resolved,
)
from flexcam.console.doubts import coarse_steps, doubts, run_doubts
from flexcam.console.fidelity import (
    choice_json,
    choice_words,
    error_table,
    plus_minus,
    trade_csv,
    trade_json,
    trade_table,
    traded_json,
)
from flexcam.console.laws import law_facts, law_json, laws_table, spectrum_table
from flexcam.console.limits import limits_json, limits_table
from flexcam.console.parting import force_bands, parting_json, parting_table
from flexcam.console.results import info_table, operation_table, periodicity, run_table, strength_table, unknowns
from flexcam.console.settings import settings_json, settings_table, settings_words
from flexcam.console.stability import dangers, growth_table, growths, stability_json, stability_table
from flexcam.console.synthesis import (
    harmonic_table,
    or_null,
    pareto_table,
    polydyne_facts,
    polydyne_table,
    synthesis_json,
    synthesis_table,
)

__all__ = [
    "CamFacts",
    "cam_json",
    "cam_table",
    "choice_json",
    "choice_words",
    "claim_table",
    "coarse_steps",
    "comparison_json",
    "comparison_table",
    "comparison_words",
    "couplings",
    "dangers",
    "doubts",
    "error_table",
    "force_bands",
    "growth_table",
    "growths",
    "harmonic_table",
    "info_table",
    "law_facts",
    "law_json",
    "laws_table",
    "left_out",
    "limits_json",
    "limits_table",
    "mac_table",
    "mode_table",
    "model_table",
    "operation_table",
    "or_null",
    "overlap_table",
    "pareto_table",
    "parting_json",
    "parting_table",
    "periodicity",
    "plus_minus",
    "polydyne_facts",
    "polydyne_table",
    "read_table",
    "resolved",
    "run_doubts",
    "run_table",
    "settings_json",
    "settings_table",
    "settings_words",
    "smoothing_table",
    "spectrum_table",
    "stability_json",
    "stability_table",
    "strength_table",
    "synthesis_json",
    "synthesis_table",
    "trade_csv",
    "trade_json",
    "trade_table",
    "traded_json",
    "unknowns",
]
