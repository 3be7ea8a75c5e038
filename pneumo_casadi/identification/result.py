"""The result of an identification."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import pandas as pd

from pneumo_casadi.data import Case, Recording
from pneumo_casadi.estimation.output_error import OutputErrorResult, RecordEstimates
from pneumo_casadi.estimation.uncertainty import Identifiability
from pneumo_casadi.estimation.wls import Prediction, WLSResult
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.warnings import (
    ResultWarning,
    Usability,
    judge_usability,
    simulation_sentence,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.runtime.presentation import Presentable
from pneumo_casadi.runtime.provenance import now
from pneumo_casadi.validation import Validation
from pneumo_casadi.valve import AnyFlowMap, AnyFlowModel, FormSelection


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
        Flows and force predicted by `wls` on the held-out records.
    validation : Validation or None
        Simulations of the held-out records; None where the case has none.
    truth : mapping of str to float, or None
        True parameters where they are known: ``truth.json`` in the case folder.
    warnings : tuple of ResultWarning
        Weaknesses of the result, graded, the most severe first; `usability` is the conclusion.
    identifiability : Identifiability or None
        Where it was asked for.
    seconds : float
        Computing time [s].
    each_record : RecordEstimates or None
        Estimates from each record alone; None for a single record or where it was not asked for.
    made : str
        When it was made, ISO 8601.

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``:

    >>> print(result.summary())
    Usable: the fit has converged...
    Identification of table1: output error converged, cost ...; ... warnings (see .warnings)
    ...
    >>> result.usability.usable.value
    'yes'
    >>> frame = result.to_frame()
    >>> bool(abs(frame.output_error["M"] / frame.truth["M"] - 1) < 0.01)
    True
    """

    case: Case
    options: IdentifyOptions
    records: tuple[Recording, ...]
    flow_map: AnyFlowMap | None
    flow: AnyFlowModel | None
    flow_selection: FormSelection | None
    wls: WLSResult
    output_error: OutputErrorResult
    predictions: tuple[Prediction, ...]
    validation: Validation | None
    truth: Mapping[str, float] | None
    warnings: tuple[ResultWarning, ...]
    identifiability: Identifiability | None
    seconds: float
    each_record: RecordEstimates | None = None
    made: str = field(default_factory=now)

    @property
    def axis(self) -> Axis:
        """The identified axis."""
        return self.output_error.axis

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Parameters of the axis and its effects, without those of the flow map and v_s.

        Those of weighted least squares come first; the others were held, or are not linear.
        """
        others = {*self.wls.names, *self.axis.flow_parameters, "v_s"}
        return (
            *self.wls.names,
            *(name for name in self.output_error.parameters.names if name not in others),
        )

    @property
    def headline(self) -> str:
        """Whether the result can be used, the case, status of the fit, number of warnings."""
        fit = self.output_error
        return (
            f"{self.usability.sentence}\nIdentification of {self.case.name}: output error "
            f"{fit.status}, cost {fit.cost:.5g}; {len(self.warnings)} warnings (see .warnings)"
        )

    @property
    def usability(self) -> Usability:
        """Whether the result can be used, by its gravest warning, with the reason."""
        reason = "the fit has converged, and no parameter contradicts what is stated of the axis"
        simulated = "." if self.validation is None else f"; {simulation_sentence(self.validation)}"
        return judge_usability(self.warnings, reason + simulated)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter: WLS and output error with their std, truth if known [SI].

        The std is that of the tables: of output error the wider of the ideal and the robust one, of
        WLS the robust one. WLS is NaN for a parameter that it does not estimate; the std of a held
        parameter is 0.
        """
        index = pd.Index(self.parameter_names, name="parameter")
        wls = self.wls.to_frame().reindex(index)
        fit = self.output_error.overview().reindex(index)
        frame = pd.DataFrame(
            {
                "wls": wls["estimate"],
                "wls_std": wls["std_hac"],
                "output_error": fit["estimate"],
                "output_error_std": fit[["std", "std_robust"]].max(axis=1),
                "unit": fit["unit"],
            }
        )
        if self.truth is not None:
            frame.insert(4, "truth", pd.Series(dict(self.truth)).reindex(frame.index))
        return frame
