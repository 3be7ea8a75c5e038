"""The sealed check: diagnoses of cases whose causes are withheld, scored against the labels.

The virtual bench draws axes and effects from a seed that the diagnosis never sees; the hash of the
labels is written first, and the labels are opened once every verdict is on disk. It needs the
extra ``bench``.
"""

from pneumo_casadi.evaluation.sealed_check.answer import Answer, read_answer
from pneumo_casadi.evaluation.sealed_check.check import WithheldOptions, check_withheld
from pneumo_casadi.evaluation.sealed_check.draw import Draw, Kind, Proportions, draw_cases
from pneumo_casadi.evaluation.sealed_check.judged import Judged
from pneumo_casadi.evaluation.sealed_check.run import Diagnosing, real_diagnosis
from pneumo_casadi.evaluation.sealed_check.score import scored
from pneumo_casadi.evaluation.sealed_check.tally import Calibration, Share, calibration

__all__ = [
    "Answer",
    "Calibration",
    "Diagnosing",
    "Draw",
    "Judged",
    "Kind",
    "Proportions",
    "Share",
    "WithheldOptions",
    "calibration",
    "check_withheld",
    "draw_cases",
    "read_answer",
    "real_diagnosis",
    "scored",
]
