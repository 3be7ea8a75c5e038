"""A verdict on the data of a case, without fitting a model: `check`."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import Any

import pandas as pd

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.driven_bench import is_metered
from pneumo_casadi.data.case import Case
from pneumo_casadi.data.case_folder import inspect_case
from pneumo_casadi.data.checks.finding import Finding, Grade, merge_findings
from pneumo_casadi.data.checks.metered_flow import NO_FLOW_MAP, metered_flows
from pneumo_casadi.data.readers.recordings import FEWEST_ROWS
from pneumo_casadi.data.record_contents import (
    RecordContents,
    Statement,
    record_contents,
    statements,
)
from pneumo_casadi.runtime.presentation import Presentable

WIDTH = 100
MOST_COLUMNS = 5
"""Records that stand side by side within this width; more of them stand below each other."""


@dataclass(frozen=True, slots=True, repr=False)
class CaseCheck(Presentable):
    """What the data of a case are worth.

    Parameters
    ----------
    case : Case
        The case.
    findings : tuple of Finding
        Mistakes and oddities, the gravest first.
    contents : tuple of RecordContents
        Figures of each record.
    statements : tuple of Statement
        What the records can and cannot tell.

    Examples
    --------
    >>> import pneumo_casadi as pc
    >>> checked = pc.check(pc.example_case())
    >>> checked.usable, checked.findings
    (True, ())
    >>> float(checked.to_frame().loc["identify", "noise_x"].round(7))
    1.51e-05
    """

    case: Case
    findings: tuple[Finding, ...]
    contents: tuple[RecordContents, ...]
    statements: tuple[Statement, ...]

    @property
    def usable(self) -> bool:
        """Whether no finding is severe."""
        return not self.findings or self.findings[0].grade is not Grade.SEVERE

    @property
    def record_next(self) -> tuple[str, ...]:
        """What to record, or to meter, next."""
        return tuple(dict.fromkeys(s.remedy for s in self.statements if not s.enough))

    @property
    def headline(self) -> str:
        """The gravest finding, or that there is none."""
        if not self.findings:
            return f"Check of {self.case.name}: none of the common mistakes"
        first = self.findings[0]
        lead = {Grade.SEVERE: "do not use", Grade.CAUTION: "use with care"}.get(first.grade, "note")
        return f"Check of {self.case.name}: {lead}: {first.sentence}"

    def to_frame(self) -> pd.DataFrame:
        """Return one row a record, SI units."""
        rows = [
            {
                "record": content.name,
                "use": "validate" if content.held_out else "identify",
                "duration": content.duration,
                "rate": content.sampling_frequency,
                "bandwidth": content.bandwidth,
                "travel": content.travel,
                "rest": content.rest,
                "forward": content.forward,
                "slow": content.slow,
                "fast": content.fast,
                **{f"noise_{name}": sigma for name, sigma in content.noise.items()},
            }
            for content in self.contents
        ]
        return pd.DataFrame(rows, columns=None if rows else ["record"]).set_index("record")

    def summary(self) -> str:
        """Return the check as text: findings, records, what they tell, what to record next."""
        lines = [fill(self.headline, WIDTH), ""]
        for finding in self.findings[1:]:
            lines.append(_item(f"{finding.grade}: {finding.sentence}"))
        lines += [""] if self.findings[1:] else []
        frame = self.to_frame()
        frame = frame.T if len(frame) <= MOST_COLUMNS else frame
        lines += [frame.to_string(float_format="{:.4g}".format, na_rep=""), ""]
        for title, enough in (("The records can tell", True), ("They cannot tell", False)):
            chosen = [item for item in self.statements if item.enough is enough]
            if chosen:
                lines += [f"{title}:", *(_item(f"{s.about}: {s.text}") for s in chosen), ""]
        if self.record_next:
            lines += ["Record next:", *(_item(advice) for advice in self.record_next), ""]
        return "\n".join(lines).rstrip()

    def as_dict(self) -> dict[str, Any]:
        """Return the check as it stands in JSON."""
        return {
            "case": self.case.name,
            "usable": self.usable,
            "findings": [finding.as_dict() for finding in self.findings],
            "records": [
                {
                    "name": content.name,
                    "use": "validate" if content.held_out else "identify",
                    "duration_s": content.duration,
                    "sampling_frequency_Hz": content.sampling_frequency,
                    "bandwidth_Hz": content.bandwidth,
                    "noise": dict(content.noise),
                    "ranges": {name: list(limits) for name, limits in content.ranges.items()},
                    "share_at_rest": content.rest,
                    "share_forward": content.forward,
                    "slow_m_per_s": content.slow,
                    "fast_m_per_s": content.fast,
                    "acceleration_m_per_s2": content.acceleration,
                    "reversals": content.reversals,
                }
                for content in self.contents
            ],
            "can_tell": [
                {"about": s.about, "enough": s.enough, "text": s.text, "remedy": s.remedy}
                for s in self.statements
            ],
            "record_next": list(self.record_next),
        }


def check(case: Case | str | Path) -> CaseCheck:
    """Check the data of a case before anything is fitted to them, in seconds.

    Looks for wrong units, clock errors, delays, swapped channels and the flow map of another
    valve, compares the noise with the noise stated, and lists what the motion can and cannot tell
    and what to record next.

    Parameters
    ----------
    case : Case or path
        A case, or the folder that holds one. From a folder, records that `read_case` refuses are
        checked as well.

    Returns
    -------
    CaseCheck

    Raises
    ------
    CaseError
        If a file cannot be read.

    Examples
    --------
    >>> import pneumo_casadi as pc
    >>> print(pc.check(pc.example_case()).headline)
    Check of table1: none of the common mistakes
    """
    case = case if isinstance(case, Case) else inspect_case(case)
    records = [(record, False) for record in case.identify]
    records += [(record, True) for record in case.validate]
    contents = tuple(
        record_contents(record, case.bench, held_out)
        for record, held_out in records
        if record.N >= FEWEST_ROWS
        and all(name in record for name in (*case.bench.kind.inputs, *case.bench.kind.outputs))
    )
    return CaseCheck(
        case,
        merge_findings((*case.findings, *_flow_map(case))),
        contents,
        statements(
            contents, case.bench, metered_flows(case.folder) if is_metered(case.bench) else {}
        ),
    )


def _flow_map(case: Case) -> Iterator[Finding]:
    bench = case.bench
    if is_metered(bench) and case.flow_map_path is None:
        yield Finding(Grade.SEVERE, "no flow map", "flow_map", f"there is {NO_FLOW_MAP}.")
    if not is_metered(bench) and case.flow_map_path is not None:
        why = "such an axis has no valves"
        if isinstance(bench, Bench):
            why = "bench.json does not say that both valves were metered (`valve.source`)"
        text = f"`{case.flow_map_path.name}` is not used: {why}."
        yield Finding(Grade.NOTE, "map not used", "flow_map", text)


def _item(text: str) -> str:
    return fill(text, WIDTH, initial_indent="- ", subsequent_indent="  ")
