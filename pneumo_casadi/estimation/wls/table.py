"""The table of results as the paper prints it (Table 1)."""

import pandas as pd

from pneumo_casadi.estimation.wls.result import WLSResult

PARAMETERS = "Parameters (ISO units)"


def results_table(result: WLSResult, *, robust: bool = False) -> pd.DataFrame:
    """Return X̂, 2σ and %σ_r of each parameter, in SI units (Table 1).

    Parameters
    ----------
    result : WLSResult
        A fit.
    robust : bool, optional
        Add the columns that allow for correlated residuals (Newey-West).

    Returns
    -------
    pandas.DataFrame
        Indexed by parameter.
    """
    columns = {
        "X̂": result.estimate,
        "2σ": result.two_sigma,
        "%σ_r": result.relative_std_percent,
    }
    if robust:
        columns["2σ (HAC)"] = 2 * result.std_hac
        columns["%σ_r (HAC)"] = 100 * result.std_hac / abs(result.estimate)
    return pd.DataFrame(columns, index=pd.Index(result.names, name=PARAMETERS))


def format_table(result: WLSResult, *, robust: bool = False) -> str:
    """Return the table as text, with the notation of the paper (3.49e-009, 8.62e-012, 0.1234).

    Below it: what was removed, which estimates the physics excludes, condition number and
    relative errors.

    Parameters
    ----------
    result : WLSResult
        What to print.
    robust : bool, optional
        As in `results_table`.
    """
    table = results_table(result, robust=robust)
    head = [PARAMETERS, *table.columns]
    columns = [[_cell(name, value) for value in table[name]] for name in table.columns]
    rows = [list(row) for row in zip(result.names, *columns, strict=True)]
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    lines = [_line(row, widths) for row in [head, *rows]]
    lines.insert(1, "  ".join("-" * width for width in widths))
    return "\n".join([*lines, "", *_notes(result)])


def _notes(result: WLSResult) -> list[str]:
    notes = [f"condition number {result.condition_number:.3g}"]
    for name, percent in result.relative_error_percent.items():
        used, dropped = result.rows_used[name], result.rows_dropped[name]
        notes.append(f"{name}: relative error {percent:.3g} %, {used} rows, {dropped} left out")
    if result.derived is not None:
        notes += [
            f"{n} = {d['value']:.4g} ± {2 * d['std']:.2g}"
            for n, d in result.derived.as_dict().items()
        ]
    notes += [
        f"removed {item.name}: {item.value:.3g}, %σ_r {item.relative_std_percent:.3g} %; relative "
        f"error {item.error_before:.3g} % with it, {item.error_after:.3g} % without"
        for item in result.removed
    ]
    notes += [f"{name}: outside its physical bounds" for name in result.out_of_bounds]
    return notes


def _cell(column: str, value: float) -> str:
    return f"{value:.4f}" if column.startswith("%") else _three_digit_exponent(value)


def _three_digit_exponent(value: float) -> str:
    mantissa, exponent = f"{value:.2e}".split("e")
    return f"{mantissa}e{exponent[0]}{int(exponent[1:]):03d}"


def _line(cells: list[str], widths: list[int]) -> str:
    first, *rest = zip(cells, widths, strict=True)
    return "  ".join([first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in rest)])
