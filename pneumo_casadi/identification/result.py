"""The result of an identification."""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from pneumo_casadi.data import Case, Recording
from pneumo_casadi.estimation.output_error import OutputErrorResult
from pneumo_casadi.estimation.uncertainty import Identifiability
from pneumo_casadi.estimation.wls import Prediction, WLSResult
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.warnings import ResultWarning
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.runtime.presentation import Presentable
from pneumo_casadi.validation import Validation
from pneumo_casadi.valve import FlowMap, FlowModel, FormSelection


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Presentable):
    """An axis identified from a case, with all that a report needs.

    Parameters
    ----------
    case : Case
        What was measured.
    options : IdentifyOptions
        What was chosen, with the form of the flow map that was used.
    records : tuple of Recording
        Those used, cut as the options ask.
    flow_map : FlowMap or None
        Measured static map; None for a force-driven axis.
    flow : FlowModel or None
        The form fitted to the map alone, before any trajectory is seen.
    flow_selection : FormSelection or None
        How that form was chosen; None for a force-driven axis.
    wls : WLSResult
        Weighted least squares.
    output_error : OutputErrorResult
        Output error, started from `wls`.
    predictions : tuple of Prediction
        Flows and effort predicted by `wls` on the held-out records.
    validation : Validation or None
        Simulations of the held-out records; None where the case has none.
    truth : mapping of str to float, or None
        True parameters where they are known: ``truth.json`` in the case folder.
    warnings : tuple of ResultWarning
        Limits of the result that matter to its use.
    identifiability : Identifiability or None
        Where it was asked for.
    seconds : float
        Computing time [s].

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``:

    >>> print(result.summary().splitlines()[0])
    Identification of table1: output error converged, cost ...; ... warnings (see .warnings)
    >>> frame = result.to_frame()
    >>> bool(abs(frame.output_error["M"] / frame.truth["M"] - 1) < 0.01)
    True
    """

    case: Case
    options: IdentifyOptions
    records: tuple[Recording, ...]
    flow_map: FlowMap | None
    flow: FlowModel | None
    flow_selection: FormSelection | None
    wls: WLSResult
    output_error: OutputErrorResult
    predictions: tuple[Prediction, ...]
    validation: Validation | None
    truth: Mapping[str, float] | None
    warnings: tuple[ResultWarning, ...]
    identifiability: Identifiability | None
    seconds: float

    @property
    def axis(self) -> Axis:
        """The identified axis."""
        return self.output_error.axis

    @property
    def headline(self) -> str:
        """Case, status of the fit, and how many warnings there are."""
        fit = self.output_error
        return (
            f"Identification of {self.case.name}: output error {fit.status}, cost {fit.cost:.5g}; "
            f"{len(self.warnings)} warnings (see .warnings)"
        )

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter: WLS and output error with robust std, truth if known [SI]."""
        wls, fit = self.wls.to_frame(), self.output_error.overview()
        frame = pd.DataFrame(
            {
                "wls": wls["estimate"],
                "wls_std": wls["std_hac"],
                "output_error": fit["estimate"].reindex(wls.index),
                "output_error_std": fit["std_robust"].reindex(wls.index),
                "unit": wls["unit"],
            }
        )
        if self.truth is not None:
            frame.insert(4, "truth", pd.Series(dict(self.truth)).reindex(frame.index))
        return frame
