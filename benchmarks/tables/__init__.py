"""Tables of the result pages: one function a table, from a result to Markdown."""

from collections.abc import Callable

from tables.criteria import criteria_moved, rules_off
from tables.diagnosis import (
    bench_sanity,
    designs,
    discovered,
    effect_coverage,
    effect_visibility,
    practice,
    rule_cases,
    term_coverage,
    verdicts,
)
from tables.estimation import coverage, emps, emps_output_error, loops, starts, truth, wls_coverage
from tables.flow import (
    flow_answer,
    flow_default,
    flow_default_answer,
    flow_forms,
    flow_metering,
)
from tables.headlines import headlines
from tables.laboratories import laboratories, mistakes
from tables.robustness import damaged, hostile, kills
from tables.sealed_checks import several, withheld, withheld_effects, withheld_forms
from tables.speed import (
    batch,
    diagnosis_time,
    many_cases,
    peers,
    peers_answer,
    peers_long,
    peers_windows,
    scaling,
    solvers,
)

#: Results of the last five sealed checks, those of `calibration.json`.
LAST_CHECKS = ("withheld_27", "withheld_28", "withheld_29", "withheld_30", "withheld_newest")

#: Tables by name: the function, and the committed results that it takes.
TABLES: dict[str, tuple[Callable[..., str], *tuple[str, ...]]] = {
    "coverage": (coverage, "wls_vs_output_error"),
    "wls_coverage": (wls_coverage, "wls_coverage"),
    "truth": (truth, "table1"),
    "emps": (emps, "emps"),
    "flow_answer": (flow_answer, "flow_sensitivity"),
    "flow_forms": (flow_forms, "flow_sensitivity"),
    "flow_metering": (flow_metering, "flow_sensitivity"),
    "flow_default_answer": (flow_default_answer, "flow_form"),
    "flow_default": (flow_default, "flow_form"),
    "laboratories": (laboratories, "laboratories"),
    "mistakes": (mistakes, "laboratories"),
    "damaged": (damaged, "campaign", "campaign_8128", "campaign_6174"),
    "hostile": (hostile, "hostile"),
    "kills": (kills, "kills"),
    "loops": (loops, "loops"),
    "peers": (peers, "peers"),
    "peers_answer": (peers_answer, "peers"),
    "peers_windows": (peers_windows, "peers"),
    "peers_long": (peers_long, "peers"),
    "solvers": (solvers, "peers"),
    "starts": (starts, "starts"),
    "scaling": (scaling, "scaling"),
    "emps_output_error": (emps_output_error, "emps_output_error"),
    "bench_sanity": (bench_sanity, "bench_sanity"),
    "practice": (practice, "practice"),
    "effect_visibility": (effect_visibility, "effect_visibility"),
    "verdicts": (verdicts, "practice_verdicts"),
    "verdicts_more": (verdicts, "practice_more_verdicts"),
    "effect_coverage": (effect_coverage, "effect_coverage"),
    "discovered": (discovered, "discovered"),
    "term_coverage": (term_coverage, "term_coverage"),
    "rule_cases": (rule_cases, "rule_cases"),
    "criteria_moved": (criteria_moved, "criteria_moved"),
    "rules_off": (rules_off, "rules_off"),
    "rules_off_rare": (rules_off, "rules_off_rare"),
    "diagnosis_time": (diagnosis_time, "diagnosis_time"),
    "batch": (batch, "batch"),
    "many_cases": (many_cases, "many_cases"),
    "designs": (designs, "design"),
    "withheld": (withheld, "withheld"),
    "withheld_effects": (withheld_effects, "withheld"),
    "withheld_forms": (withheld_forms, "withheld_forms"),
    "withheld_newest": (withheld_forms, "withheld_newest"),
    "sealed_checks": (several, "calibration", *LAST_CHECKS),
    "headlines": (
        headlines,
        "table1",
        "wls_vs_output_error",
        "peers",
        "withheld_forms",
        "withheld_later",
        "withheld_24",
        "withheld_25",
        *LAST_CHECKS,
    ),
}
