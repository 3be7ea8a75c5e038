"""A small case to start from: the example as a logger of one's own would have written it."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.bench_file import bench_content
from pneumo_casadi.data.case import Case
from pneumo_casadi.data.case_folder import example_case, read_case
from pneumo_casadi.data.readers.columns import COLUMNS_FILE
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.runtime.atomic_files import atomic_folder
from pneumo_casadi.runtime.output_folder import check_new

ROWS_PER_ROW = 5
"""Of the example at 5 kHz; 1 kHz is what most loggers do, and keeps the files small."""


def write_example(folder: str | Path) -> Case:
    """Write a case folder with columns in bar gauge, millimetres and milliseconds.

    Parameters
    ----------
    folder : str or Path
        Folder to make; it must not exist, or be empty.

    Returns
    -------
    Case
        The case as it is read back, by its ``columns.json``.

    Raises
    ------
    CaseError
        If the folder holds something.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as scratch:
    ...     case = write_example(Path(scratch) / "my_axis")
    ...     (case.folder / "identify.csv").read_text("utf-8").splitlines()[0]
    'ms,valve,pA,pB,pos,ref'
    >>> case.bench.sampling_frequency, case.findings
    (1000.0, ())
    """
    folder = Path(folder)
    check_new(folder)
    example = example_case()
    bench = example.bench
    assert isinstance(bench, Bench) and example.flow_map_path is not None
    slower = replace(bench, sampling_frequency=bench.sampling_frequency / ROWS_PER_ROW)
    with atomic_folder(folder, over=False) as draft:
        _write_json(draft / "bench.json", bench_content(slower))
        _write_json(draft / COLUMNS_FILE, _columns(bench))
        records = zip(("identify", "validate"), (*example.identify, *example.validate), strict=True)
        for name, record in records:
            short = record.decimate(ROWS_PER_ROW, ("u_P", "u_N"))
            _as_logged(short, bench).to_csv(draft / f"{name}.csv", index=False)
        flow_map = pd.read_csv(example.flow_map_path)
        flow_map.to_csv(draft / "flow_map.csv", index=False)
    return read_case(folder)


def _columns(bench: Bench) -> dict[str, Any]:
    end = -bench.stroke / 2
    return {
        "t_s": ["ms", "ms"],
        "u_P_V": "valve",
        "u_N_V": {"column": "valve", "scale": -1},
        "p_P_Pa": {"column": "pA", "unit": "bar", "offset": bench.p_ext},
        "p_N_Pa": {"column": "pB", "unit": "bar", "offset": bench.p_ext},
        "x_m": {"column": "pos", "unit": "mm", "offset": end},
        "x_ref_m": {"column": "ref", "unit": "mm", "offset": end},
    }


def _as_logged(record: Recording, bench: Bench) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "ms": np.round(1e3 * (record.t - record.t[0]), 3),
            "valve": record["u_P"].round(4),
            "pA": ((record["p_P"] - bench.p_ext) / 1e5).round(5),
            "pB": ((record["p_N"] - bench.p_ext) / 1e5).round(5),
            "pos": (1e3 * (record["x"] + bench.stroke / 2)).round(3),
            "ref": (1e3 * (record["x_ref"] + bench.stroke / 2)).round(4),
        }
    )


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", "utf-8")
