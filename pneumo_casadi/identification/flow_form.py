"""The static flow of a case: its measured map, and the model of eq. 12 or another form."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from pneumo_casadi.data import Bench, Case, FlowSource, Recording
from pneumo_casadi.data.checks.metered_flow import NO_FLOW_MAP
from pneumo_casadi.errors import CaseError
from pneumo_casadi.estimation.equation_error.conductances import estimate_conductances
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.valve import (
    PAPER_DEGREES,
    AnyFlowMap,
    AnyFlowModel,
    FlowForm,
    FlowMap,
    FlowMapPair,
    FlowModel,
    FlowPair,
    FormSelection,
    choose_flow_form,
    fit_polynomials,
    fit_spline,
    iso6358_from_data_sheet,
    read_flow_map,
)
from pneumo_casadi.valve.choice.form_selection import ISO6358_FITS


def resolve_flow_form(
    case: Case, options: IdentifyOptions
) -> tuple[IdentifyOptions, FormSelection | None]:
    """Return the options with the form of the flow map decided, and how it was chosen.

    Returns
    -------
    tuple
        Options whose `flow_form` is not None, and the selection; the options as they are and None
        for a force-driven axis.

    Raises
    ------
    CaseError
        If a servo axis has no flow map, no form can be fitted to it, or degrees are given where
        no polynomials are fitted.
    """
    if not isinstance(case.bench, Bench) or not case.bench.valves.metered:
        if options.degrees is not None:
            raise CaseError(f"degrees {options.degrees}: {case.name} has no metered flow map")
        return options, None
    if options.degrees is not None and options.flow_form not in (None, FlowForm.POLYNOMIALS):
        raise CaseError(
            f"degrees {options.degrees}: the form {options.flow_form.value} has none; leave them "
            "out, or ask for polynomials"
        )
    if options.flow_form is not None:
        selection = FormSelection.given(options.flow_form, options.degrees)
    else:
        table, _ = read_flow_maps(case, case.bench)
        selection = choose_flow_form(table, T=case.bench.T, degrees=options.degrees)
    return replace(options, flow_form=selection.chosen, degrees=selection.degrees), selection


def read_flow(
    case: Case, options: IdentifyOptions, records: Sequence[Recording] | None = None
) -> tuple[AnyFlowMap | None, AnyFlowModel | None]:
    """Read the flow map of a servo axis and fit the form asked for, or the one chosen.

    Where the two valves differ, the form that suits chamber P's valve is fitted to both. For an
    unmetered valve, write down what the data sheet states; where it states nothing, `records` (by
    default all to identify on) give the conductances.

    Returns
    -------
    tuple
        Measured table and model, a pair of each where the valves differ; no table for an
        unmetered valve, neither for an axis without valves.

    Raises
    ------
    CaseError
        If a servo axis has no flow map.
    """
    if not isinstance(case.bench, Bench):  # no valves: nothing was metered
        return None, None
    if not case.bench.valves.metered:
        return None, _unmetered(case.bench, records or case.identify)
    chosen, _ = resolve_flow_form(case, options)
    assert chosen.flow_form is not None
    fits: dict[FlowForm, Callable[[FlowMap], FlowModel]] = {
        FlowForm.POLYNOMIALS: partial(fit_polynomials, degrees=chosen.degrees or PAPER_DEGREES),
        FlowForm.SPLINE: fit_spline,
        **{form: partial(fit, T=case.bench.T) for form, fit in ISO6358_FITS.items()},
    }
    fit = fits[chosen.flow_form]
    table, table_N = read_flow_maps(case, case.bench)
    if table_N is None:
        return table, fit(table)
    return FlowMapPair(table, table_N), FlowPair(fit(table), fit(table_N))


def _unmetered(bench: Bench, records: Sequence[Recording]) -> AnyFlowModel:
    if any(valve.source is FlowSource.METERED for valve in bench.valves):
        raise CaseError(
            "`valve`: one valve is metered and the other is not; write the source of both as "
            '"data sheet" or "none", or meter both'
        )
    unknown = any(valve.source is FlowSource.NONE for valve in bench.valves)
    gains = estimate_conductances(bench, records) if unknown else None
    P, N = (iso6358_from_data_sheet(bench, valve, gains) for valve in bench.valves)
    return P if bench.valves.P == bench.valves.N else FlowPair(P, N)


def read_flow_maps(case: Case, bench: Bench) -> tuple[FlowMap, FlowMap | None]:
    """Read the metered points of the valves: of both, or of P and of N where they differ."""
    if case.flow_map_path is None:
        raise CaseError(f"{case.folder}: {NO_FLOW_MAP}")
    P, N = (
        None if path is None else read_flow_map(path, p_supply=bench.p_supply, p_ext=bench.p_ext)
        for path in (case.flow_map_path, case.flow_map_N_path)
    )
    assert P is not None
    return P, N
