"""Parts of the validation that read measured trunk and ground impacts, and Searle's relation."""

import math
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest

from mcstudy.errors import UserError
from studies.validation import ground_impact, trunk_impacts
from studies.validation.separation import median_searle_ratio, share_within_searle

MEASURED = Path("../shared/measured")
NEEDED = pytest.mark.skipif(
    not (MEASURED / trunk_impacts.FILE).exists(), reason="the measured data are not here"
)
GRAVITY = 9.80665


def departures(along: float, up: float, fall: float, friction: float) -> pd.DataFrame:
    """Return one departure with the way that flight, landing and sliding take in closed form."""
    flight = (up + math.sqrt(up**2 + 2.0 * GRAVITY * fall)) / GRAVITY
    down = math.sqrt(up**2 + 2.0 * GRAVITY * fall)
    # Friction takes its share of the vertical impulse at landing.
    left = along - friction * down
    way = along * flight + left**2 / (2.0 * friction * GRAVITY)
    columns = ["along", "up", "fall", "way", "friction"]
    return pd.DataFrame([[along, up, fall, way, friction]], columns=columns)


@pytest.mark.parametrize("friction", [0.4, 0.66])
@pytest.mark.parametrize(("along", "up"), [(9.0, 0.0), (9.0, 4.0), (12.0, 2.0), (9.0, -2.0)])
def test_searles_relation_is_flight_landing_and_sliding(
    along: float, up: float, friction: float
) -> None:
    table = departures(along, up, 0.8, friction)
    assert median_searle_ratio(table) == pytest.approx(1.0, rel=1e-9)
    if up > 0.0:
        assert share_within_searle(table) == 1.0


def test_only_rising_departures_are_held_to_the_bounds() -> None:
    falling = departures(9.0, -4.0, 0.8, 0.6)
    rising = departures(9.0, 3.0, 0.8, 0.6)
    far = rising.assign(way=2.0 * rising["way"])
    assert share_within_searle(pd.concat([falling, rising])) == 1.0
    assert share_within_searle(pd.concat([falling, rising, far])) == 0.5


@NEEDED
@pytest.mark.measured
def test_every_group_of_hub_tests_is_simulated() -> None:
    part = trunk_impacts.validate(1, MEASURED)
    assert len(part.checks) == 10
    for c in part.checks:
        assert c.verdict == "inside", (c.key, c.ours, c.reference)


@pytest.mark.parametrize(
    ("module", "text"),
    [
        (trunk_impacts, "region,peak_force_kN\nthorax_oblique_30deg,2.0\n"),
        (trunk_impacts, ""),
        (ground_impact, "dummy,hic\nQ3,1000\n"),
        (ground_impact, "dummy,hic15\nQ3,many\n"),
    ],
)
def test_a_broken_file_is_one_line(module: ModuleType, text: str, tmp_path: Path) -> None:
    path = tmp_path / module.FILE
    path.write_text(text)
    with pytest.raises(UserError, match=path.name) as caught:
        module.validate(1, tmp_path)
    assert "\n" not in str(caught.value)


def test_an_unknown_region_is_refused(tmp_path: Path) -> None:
    row = dict.fromkeys(trunk_impacts.COLUMNS, 1.0) | {"region": "knee"}
    pd.DataFrame([row]).to_csv(tmp_path / trunk_impacts.FILE, index=False)
    with pytest.raises(UserError, match=r"column 'region': 'knee' is none of"):
        trunk_impacts.validate(1, tmp_path)


@NEEDED
@pytest.mark.measured
def test_dummy_records_are_the_seventeen() -> None:
    table = pd.read_csv(MEASURED / ground_impact.FILE)
    assert len(table) == 17
    assert np.median(table.loc[table["dummy"] == "Q3", "hic15"]) == pytest.approx(1245, rel=0.01)
