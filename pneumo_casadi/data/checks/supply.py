"""Supply pressure: against the chambers, and against the pressure at which the map no longer fills.

Also the ranges of the flow map: commands beyond those that were metered.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.checks.metered_flow import MeteredFlow
from pneumo_casadi.data.readers.column_entries import ColumnEntries
from pneumo_casadi.data.recording.recording import Recording

GAUGE_ACCURACY = 0.02
"""Of a pressure gauge at the supply, relative."""
OTHER_SUPPLY = 0.05
"""From this difference on, the map was metered at another setting of the regulator."""
DROOP = 0.4
"""How far the flow lowers a supply below its setting at most, over the ambient pressure."""
OFTEN = 0.05
"""Share of the rows from which an excess is no compression of a closed chamber by the load."""
RARE = 1e-3
"""Share of the rows up to which an excess is not worth a word."""


def check_supply(
    recording: Recording,
    bench: Bench,
    flows: Mapping[str, MeteredFlow],
    entries: ColumnEntries,
) -> Iterator[Finding]:
    """Yield what contradicts the supply pressure, and commands beyond the map."""
    yield from _chambers_above(recording, bench)
    yield from _recorded_supply(recording, bench, entries)
    for flow in {id(flow): flow for flow in flows.values()}.values():
        yield from _map_of_other_supply(flow, bench)
    yield from _commands_beyond(recording, flows)


def _chambers_above(recording: Recording, bench: Bench) -> Iterator[Finding]:
    if "p_supply" in recording:
        return
    limit = (1 + GAUGE_ACCURACY) * bench.p_supply + (5 * bench.noise.p if bench.noise else 0.0)
    above = {name: float(np.mean(recording[name] > limit)) for name in ("p_P", "p_N")}
    name = max(above, key=lambda channel: above[channel])
    if above[name] <= OFTEN:
        return
    highest = float(recording[name].max())
    gauge = bench.p_supply + bench.p_ext
    yield Finding(
        Grade.SEVERE,
        "chambers above supply",
        "p_supply",
        f"`{name}` lies above the supply pressure {bench.p_supply:g} Pa in {100 * above[name]:.2g} "
        f"% of the rows, up to {highest:.4g} Pa; give the absolute pressure at the valve's inlet.",
        "bench.json" if highest <= 1.02 * gauge else "",
        {"p_supply_Pa": gauge} if highest <= 1.02 * gauge else {},
        recording.name,
    )


def _recorded_supply(
    recording: Recording, bench: Bench, entries: ColumnEntries
) -> Iterator[Finding]:
    """Yield a finding where the recorded supply pressure is not the one of the bench."""
    if "p_supply" not in recording:
        return
    recorded = float(np.median(recording["p_supply"]))
    if abs(recorded / bench.p_supply - 1) < OTHER_SUPPLY:
        return
    gauge = abs(recorded + bench.p_ext - bench.p_supply) < DROOP * bench.p_ext
    question = "is the column a gauge pressure?" if gauge else "correct one of them."
    yield Finding(
        Grade.SEVERE if gauge else Grade.CAUTION,
        "other supply pressure",
        "p_supply",
        f"`p_supply` is {recorded:.4g} Pa in the record (median) and {bench.p_supply:.4g} Pa in "
        f"bench.json: {question}",
        "columns.json" if gauge else "",
        entries.corrected("p_supply", offset=bench.p_ext) if gauge else {},
        recording.name,
    )


def _map_of_other_supply(flow: MeteredFlow, bench: Bench) -> Iterator[Finding]:
    metered = flow.supply_pressure
    if metered is None or abs(metered / bench.p_supply - 1) < GAUGE_ACCURACY:
        return
    remedy = "meter it at the supply pressure of the records, or correct `p_supply`."
    suggestion: dict[str, Any] = {}
    gauge = bench.p_supply + bench.p_ext
    if abs(metered / gauge - 1) < GAUGE_ACCURACY:
        remedy, suggestion = "is `p_supply` a gauge pressure?", {"p_supply_Pa": gauge}
    elif abs((metered + bench.p_ext) / bench.p_supply - 1) < GAUGE_ACCURACY:
        remedy = "are the pressures of the map gauge pressures?"
    yield Finding(
        Grade.SEVERE if abs(metered / bench.p_supply - 1) > OTHER_SUPPLY else Grade.CAUTION,
        "map of another supply pressure",
        "flow_map, p_supply",
        f"{flow.path.name}: the map of another valve or another supply: its open valve no longer "
        f"fills at {metered:.4g} Pa, the supply pressure is {bench.p_supply:.4g} Pa; {remedy}",
        "bench.json" if suggestion else "",
        suggestion,
    )


def _commands_beyond(recording: Recording, flows: Mapping[str, MeteredFlow]) -> Iterator[Finding]:
    for chamber, flow in flows.items():
        u, low, high = recording[f"u_{chamber}"], float(flow.u.min()), float(flow.u.max())
        share = float(np.mean((u < low) | (u > high)))
        if share > RARE:
            yield Finding(
                Grade.CAUTION,
                "commands beyond the map",
                f"u_{chamber}, flow_map",
                f"`u_{chamber}` runs from {u.min():.3g} to {u.max():.3g} V, the map from {low:.3g} "
                f"to {high:.3g} V: {100 * share:.2g} % of the rows rest on extrapolation; meter "
                "the valve over the whole range of commands.",
                source=recording.name,
            )
