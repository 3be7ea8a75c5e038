"""Tables on the accuracy of the estimators."""

import itertools
from collections.abc import Mapping
from typing import Any

from tables.common import SYMBOLS, rows


def truth(result: Mapping[str, Any]) -> str:
    """Both estimators beside the truth, on independent data."""
    head = ["parameter", "unit", "WLS ± 2σ", "OE ± 2σ", "truth", "WLS − truth", "OE − truth"]
    body = []
    for name, entry in result["parameters"].items():
        estimates = [
            f"{entry[key]:.4g} ± {2 * max(entry[f'{key}_std'], entry[f'{key}_std_{wide}']):.2g}"
            for key, wide in (("wls", "hac"), ("output_error", "robust"))
        ]
        errors = [f"{entry[f'{key}_error_percent']:+.2f} %" for key in ("wls", "output_error")]
        symbol = SYMBOLS.get(name, name)
        body.append([symbol, entry["unit"], *estimates, f"{entry['truth']:.4g}", *errors])
    for name, entry in result["derived"].items():
        value = f"{entry['value']:.4f} ± {2 * entry['std_robust']:.2g}"
        body.append([name, "1", "", value, f"{entry['truth']:.4f}", "", f"{entry['error']:+.4f}"])
    return rows(head, body)


def coverage(result: Mapping[str, Any]) -> str:
    """Bias, spread and coverage of both estimators; of OE under each noise, disturbed or not."""
    head = ["parameter"]
    for label in ("WLS", "OE"):
        head += [f"{label} bias %", f"{label} spread %", f"{label} coverage %"]
    head.append("OE error / bound")
    under = {"white": result, "coloured": result["coloured"]}
    under |= {f"{noise}, disturbed": item for noise, item in result["disturbed"].items()}
    head += [f"printed, {noise}" for noise in under]
    body = []
    for name in result["wls"]:
        row = [SYMBOLS.get(name, name)]
        for key in ("wls", "output_error"):
            entry = result[key][name]
            spread = 100 * entry["spread"] / abs(entry["truth"])
            row += [
                f"{entry['bias_percent']:+.3f}",
                f"{spread:.3f}",
                f"{entry['coverage_percent']:.1f}",
            ]
        row.append(f"{result['output_error'][name]['rms_error_over_bound']:.2f}")
        printed = [item["output_error_printed"][name] for item in under.values()]
        row += [f"{item['coverage_percent']:.1f}" for item in printed]
        body.append(row)
    return rows(head, body)


def wls_coverage(result: Mapping[str, Any]) -> str:
    """Coverage of both intervals of WLS, under white and coloured noise."""
    head = [
        "coverage of the 95 % interval",
        *(SYMBOLS.get(n, n) for n in result["white"]["printed"]),
    ]
    body = []
    kinds = (("", result), (", disturbed", result["disturbed"]))
    for key, label in (("eq_16", "eq. 16"), ("printed", "as printed")):
        for (disturbed, under), noise in itertools.product(kinds, ("white", "coloured")):
            found = under[noise][key]
            shares = [
                f"{found[name]['coverage_percent']:.1f}" if name in found else ""
                for name in result["white"]["printed"]
            ]
            body.append([f"{label}, {noise} noise{disturbed}", *shares])
    return rows(head, body)


def loops(result: Mapping[str, Any]) -> str:
    """Bias of output error, loop open and closed, by situation: mean ± 2 of its errors, spread."""
    names = ("X_s2", "X_s3", "M", "f_v", "F_c_plus")
    head = ["error in % (spread)", "loop", *(SYMBOLS.get(name, name) for name in names)]
    body = []
    for situation, by_loop in result["situations"].items():
        for loop, entry in by_loop.items():
            row = [situation, loop]
            for name in names:
                bias, error = entry["bias_percent"][name], entry["bias_standard_error"][name]
                spread = entry["spread_percent"][name]
                row.append(f"{bias:+.2f} ± {2 * error:.2f} ({spread:.2f})")
            body.append(row)
    return rows(head, body)


def starts(result: Mapping[str, Any]) -> str:
    """How many starts reach the optimum."""
    return (
        f"{result['reached']} of {result['starts']} starts with every one of {result['free']} "
        f"parameters off by up to ±{100 * result['spread']:.0f} % reach the same optimum, in "
        f"{result['median_iterations']:g} iterations at the median."
    )


def emps(result: Mapping[str, Any]) -> str:
    """Put ours beside the published figures of a real axis."""
    head = ["EMPS", "ours", "authors"]
    body = []
    for variant in ("symmetric", "asymmetric"):
        ours, theirs = result[variant], result["authors"][variant]
        for name, value in theirs["parameters"].items():
            errors = ours["standard_errors"][name], theirs["standard_errors"][name]
            body.append(
                [
                    f"{variant} {name}",
                    f"{ours['parameters'][name]:.4f} ± {errors[0]:.4f}",
                    f"{value:.4f} ± {errors[1]:.4f}",
                ]
            )
        for key, label in (
            ("relative_error_percent", "force error, %"),
            ("cross_validation_percent", "force error on pulses, %"),
        ):
            published = f"{theirs[key]:.4f}" if key in theirs else ""
            body.append([f"{variant} {label}", f"{ours[key]:.4f}", published])
    for record, signals in result["authors"]["closed_loop"].items():
        for signal, value in signals.items():
            ours = result["closed_loop"][record][signal]
            body.append([f"closed loop, {record}, {signal}, %", f"{ours:.4g}", f"{value:.4g}"])
    return rows(head, body)


def emps_output_error(result: Mapping[str, Any]) -> str:
    """Put closed- and open-loop errors side by side for every estimator of a real axis."""
    head = ["EMPS", "closed loop x, v %", "on pulses x, v %", "open loop on pulses, mm"]

    def loop(errors: Mapping[str, float]) -> str:
        return f"{errors['position']:.5f}, {errors['velocity']:.3f}"

    theirs = result["authors"]["closed_loop"]
    body = [["authors", loop(theirs["identification"]), loop(theirs["pulses"]), ""]]
    for name, entry in result["estimators"].items():
        errors = entry["closed_loop_percent"]
        open_loop = f"{entry['open_loop_mm']['pulses']:.2f}"
        body.append([name, loop(errors["identification"]), loop(errors["pulses"]), open_loop])
    for name, value in result["black_boxes_mm"].items():
        body.append([f"{name} (published)", "", "", f"{value:g}"])
    return rows(head, body)
