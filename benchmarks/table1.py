"""Question: how near do both estimators come to known parameters on independent data.

Data: `table1/`, 20 s at 5 kHz recorded from a bench program that shares no equation with this
package (set-valued friction, spool-edge ISO 6358 valve, quantised and noisy sensors); its true
parameters are the estimates of the paper's Table 1. Nothing is random here.
"""

import argparse
from pathlib import Path
from typing import Any

import provenance

from pneumo_casadi.identification.identify import identify
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.report.tables import paper
from pneumo_casadi.valve import PAPER_DEGREES, FlowForm

SEED = 0
TRUTH = {name: value for name, (value, _) in paper.TABLE_1.items()}


def run(folder: Path, seconds: float | None) -> dict[str, Any]:
    """Identify the case and compare with the truth."""
    as_published = IdentifyOptions(FlowForm.POLYNOMIALS, PAPER_DEGREES, end=seconds)
    result = identify(folder, as_published)
    oe, wls = result.output_error, result.wls
    std_hac = dict(zip(wls.parameters.names, wls.std_hac.tolist(), strict=True))
    parameters = {
        name: {
            "truth": truth,
            "wls": wls.parameters[name].value,
            "unit": oe.parameters[name].unit,
            "wls_std": float(wls.std[wls.names.index(name)]),
            "wls_std_hac": std_hac[name],
            "wls_error_percent": 100 * (wls.parameters[name].value / truth - 1),
            "output_error": oe.parameters[name].value,
            "output_error_std": oe.std(name),
            "output_error_std_robust": oe.std(name, robust=True),
            "output_error_error_percent": 100 * (oe.parameters[name].value / truth - 1),
        }
        for name, truth in TRUTH.items()
    }
    ratios = {"k_P": TRUTH["X_s3"] / TRUTH["X_s2"], "k_N": TRUTH["X_s6"] / TRUTH["X_s5"]}
    validation = result.validation
    errors = (
        {}
        if validation is None
        else {
            "open_loop": {n: e.percent for n, e in validation.open_loop.items()},
            "closed_loop": {n: e.percent for n, e in (validation.closed_loop or {}).items()},
        }
    )
    return {
        "parameters": parameters,
        "derived": {
            k: {
                "truth": truth,
                "value": oe.derived[k].value,
                "std_robust": oe.derived[k].std_robust,
                "error": oe.derived[k].value - truth,
            }
            for k, truth in ratios.items()
        },
        "validation_percent": errors,
        "iterations": oe.iterations,
        "samples": sum(record.N for record in result.records),
        "seconds": result.seconds,
    }


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the folder table1/")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="the first four seconds only")
    arguments = parser.parse_args()
    result = run(arguments.data, 4.0 if arguments.quick else None)
    result |= provenance.made(SEED, arguments.quick)
    for name, parameter in result["parameters"].items():
        wls, oe = parameter["wls_error_percent"], parameter["output_error_error_percent"]
        print(f"{name:10s} WLS {wls:+7.2f} %   OE {oe:+7.2f} %")
    for name, parameter in result["derived"].items():
        print(f"{name:10s} OE {parameter['value']:.4f} (truth {parameter['truth']:.4f})")
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
