"""What laboratories own raises no alarm; the commonest mistakes with it are named."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from pneumo_casadi.data import (
    Arrangement,
    FlowSource,
    Grade,
    NoController,
    PidController,
    check_records,
    read_case,
    write_case,
)
from pneumo_casadi.data.checks.metered_flow import metered_flows
from pneumo_casadi.virtual_bench import Laboratory, make_case

pytest.importorskip("numba")

LABORATORIES = {
    "vertical": Laboratory(angle_deg=90.0),
    "measured load": Laboratory(load_force=30.0),
    "recorded supply": Laboratory(supply=True),
    "double rod": Laboratory(double_rod=True),
    "two valves": Laboratory(other_valve=0.15),
    "one 5/3 valve": Laboratory(arrangement=Arrangement.ONE_5_3),
    "data sheet": Laboratory(source=FlowSource.DATA_SHEET, data_sheet_error=0.3),
    "no map": Laboratory(source=FlowSource.NONE),
    "no law": Laboratory(controller=NoController(), reference=False),
    "pid": Laboratory(controller=PidController(k_p=2.4, k_i=0.5, u_max=5.0)),
    "jitter and gaps": Laboratory(jitter=0.1, gaps=((3.0, 3.2),)),
    "pressures": Laboratory(pressures=True),
}
#: Only the pressures tell there that a command is late: for that they need more seconds.
WITHOUT_ITS_LAW = ("no law", "pid")
MISTAKES = {
    "gauge pressures": lambda r, b: {name: r[name] - b.p_ext for name in ("p_P", "p_N")},
    "unit": lambda r, b: {name: 1e-5 * r[name] for name in ("p_P", "p_N")},
    "swapped chambers": lambda r, b: {"p_P": r["p_N"], "p_N": r["p_P"]},
    "swapped commands": lambda r, b: {name: -r[name] for name in ("u_P", "u_N") if name in r},
    "delay of u": lambda r, b: {name: np.roll(r[name], 1) for name in ("u_P", "u_N") if name in r},
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Return a function that records each laboratory once."""
    known = {}

    def record(name):
        if name not in known:
            folder = tmp_path_factory.mktemp("laboratory") / "case"
            duration = 12.0 if name in WITHOUT_ITS_LAW else 8.0
            known[name] = make_case(
                folder, 41, duration=duration, laboratory=LABORATORIES[name]
            ).case
        return known[name]

    return record


@pytest.mark.slow
@pytest.mark.parametrize("name", LABORATORIES)
def test_a_laboratory_raises_no_alarm(name, recorded):
    assert read_case(recorded(name).folder).findings == ()


@pytest.mark.slow
@pytest.mark.parametrize("mistake", MISTAKES)
@pytest.mark.parametrize("name", LABORATORIES)
def test_a_mistake_is_named_first_in_every_laboratory(name, mistake, recorded):
    case = recorded(name)
    changes = [MISTAKES[mistake](record, case.bench) for record in case.identify]
    if not all(changes):
        pytest.skip("no command is recorded")
    wrong = [
        record.with_channels(change) for record, change in zip(case.identify, changes, strict=True)
    ]
    flows = metered_flows(case.folder)
    findings = check_records(wrong, case.bench, flows, refuse=False)
    assert findings[0].name == mistake
    expected = Grade.CAUTION if (name, mistake) == ("pressures", "gauge pressures") else None
    assert findings[0].grade is (expected or Grade.SEVERE)


@pytest.mark.slow
def test_the_one_command_of_a_5_3_valve_is_shifted_by_its_own_column(recorded, tmp_path):
    case = recorded("one 5/3 valve")
    late = [r.with_channels(MISTAKES["delay of u"](r, case.bench)) for r in case.identify]
    folder = tmp_path / "case"
    write_case(folder, case.bench, late, flow_map=case.flow_map_path)
    table = pd.read_csv(folder / "identify.csv.gz")
    table = table.rename(columns={"u_P_V": "u_V"}).drop(columns="u_N_V", errors="ignore")
    table.to_csv(folder / "identify.csv.gz", index=False)
    (finding,) = read_case(folder).findings
    assert finding.suggestion == {"u_V": {"column": "u_V", "rows_late": 1}}
    (folder / "columns.json").write_text(json.dumps(dict(finding.suggestion)), "utf-8")
    assert read_case(folder).findings == ()


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["valve_dead_zone", "valve_mismatch", "pressure_sensor_lag"])
def test_a_hidden_effect_of_the_valve_is_no_severe_finding(effect, made_case):
    case = read_case(made_case(31, **{effect: "large"}).folder)
    assert {finding.grade for finding in case.findings} == {Grade.CAUTION}


@pytest.mark.slow
def test_an_unstated_weight_is_not_taken_for_gauge_pressures(recorded):
    case = recorded("vertical")
    level = replace(case.bench, load=type(case.bench.load)())
    findings = check_records(case.identify, level, metered_flows(case.folder))
    assert not [finding for finding in findings if finding.grade is Grade.SEVERE]


@pytest.mark.slow
@pytest.mark.parametrize(
    "laboratory", [Laboratory(load_force=60.0), Laboratory(load_force=60.0, pressures=True)]
)
def test_a_measured_force_with_the_other_sign_is_named(laboratory, tmp_path):
    case = make_case(tmp_path / "case", 3, duration=8.0, laboratory=laboratory).case
    assert not check_records(case.identify, case.bench, metered_flows(case.folder), refuse=False)
    turned = [record.with_channels({"F_load": -record["F_load"]}) for record in case.identify]
    findings = check_records(turned, case.bench, metered_flows(case.folder), refuse=False)
    assert (findings[0].name, findings[0].grade) == ("sign of the force", Grade.SEVERE)
    assert "F_load" in str(dict(findings[0].suggestion))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "name"),
    [
        (lambda p, bench: p - bench.p_ext, "other supply pressure"),
        (lambda p, bench: 1e-5 * p, "unit"),
        (lambda p, bench: np.where(np.arange(p.size) == 500, 0.0, p), "out of range"),
    ],
)
def test_a_recorded_supply_that_cannot_be_is_named(change, name, recorded):
    case = recorded("recorded supply")
    wrong = [
        record.with_channels({"p_supply": change(record["p_supply"], case.bench)})
        for record in case.identify
    ]
    findings = check_records(wrong, case.bench, metered_flows(case.folder), refuse=False)
    assert (findings[0].name, findings[0].grade) == (name, Grade.SEVERE)
    assert "p_supply" in findings[0].about


@pytest.mark.slow
def test_a_single_acting_cylinder_has_one_pressure(recorded):
    case = recorded("pressures")
    bench = replace(case.bench, S_N=0.0)
    records = [
        replace(r, channels={n: v for n, v in r.channels.items() if n != "p_N"})
        for r in case.identify
    ]
    findings = check_records(records, bench, {}, refuse=False)  # the force is missing, not p_N
    assert all("p_N" not in finding.about for finding in findings)
