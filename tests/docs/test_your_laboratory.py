"""Every situation of the page is recorded, and read with the file that the page gives."""

import json
import re
from pathlib import Path

import pytest

import pneumo_casadi as pc
from pneumo_casadi.data import Arrangement, FlowSource, NoController
from pneumo_casadi.identification.flow_form import read_flow
from pneumo_casadi.identification.starting_axis import make_axis, with_flow_from_records
from pneumo_casadi.virtual_bench import Laboratory, make_case

PAGE = Path(__file__).parents[2] / "docs" / "how_to" / "your_laboratory.md"
BLOCK = re.compile(r"<!-- file: (\w+)/bench\.json -->\n```json\n(.*?)```", re.DOTALL)
FILES = dict(BLOCK.findall(PAGE.read_text("utf-8")))
#: What each file of the page describes; a supply that is recorded needs no field.
LABORATORIES = {
    "sheet": Laboratory(source=FlowSource.DATA_SHEET, data_sheet_error=0.3),
    "nothing": Laboratory(source=FlowSource.NONE),
    "accuracy": Laboratory(),
    "two_sheets": Laboratory(source=FlowSource.DATA_SHEET, other_valve=0.2),
    "five_three": Laboratory(arrangement=Arrangement.ONE_5_3),
    "sensors": Laboratory(v_noise=2e-3, a_noise=0.2, load_force=20.0, supply=True),
    "vertical": Laboratory(angle_deg=90.0),
    "double_rod": Laboratory(double_rod=True),
    "pressures": Laboratory(pressures=True),
    "jitter": Laboratory(jitter=0.1, gaps=((0.6, 0.9),)),
    "manual": Laboratory(controller=NoController(), reference=False),
}
#: Of each record [s].
DURATION = 1.6
#: Fields that differ from axis to axis: those of the recorded one count.
OF_THE_AXIS = {
    *("sampling_frequency_Hz", "S_P_m2", "S_N_m2", "stroke_m", "p_ext_Pa", "p_supply_Pa"),
    *("T_K", "r_J_per_kg_K", "datasheet", "sensor_noise"),
}


def test_the_page_shows_every_situation():
    assert FILES.keys() == LABORATORIES.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", LABORATORIES)
def test_a_case_with_the_file_of_the_page_is_read_and_identified(name, tmp_path):
    folder = tmp_path / name
    made = make_case(folder, 3, fs=1000.0, duration=DURATION, laboratory=LABORATORIES[name])
    own, page = json.loads((folder / "bench.json").read_text()), json.loads(FILES[name])
    kept = {key: value for key, value in own.items() if key in OF_THE_AXIS}
    if page.get("controller", {}).get("type") == "proportional":
        kept["controller"] = own["controller"]
    (folder / "bench.json").write_text(json.dumps(page | kept))
    case = pc.read_case(folder)
    assert not [finding for finding in case.findings if finding.grade == "severe"]
    _, flow = read_flow(case, pc.IdentifyOptions())
    axis = with_flow_from_records(make_axis(case, flow), case.identify)
    fit = pc.fit_wls(axis, case.identify)
    assert fit.parameters["M"].value == pytest.approx(made.labels["truth"]["M"], rel=0.05)
