"""Make the example of measured data in ``configs/hood_tests``: six simulated headform tests.

Run as ``python -m scripts.example_tests``. The curves are drawn from a corridor and hidden in
signals with noise, offset and lead-in, for `mcstudy fit-stiffness`.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from models.contact.corridor import load_corridors
from models.registry import load_model

FOLDER = Path("configs/hood_tests")
SPEEDS = (8.33, 8.33, 8.33, 9.72, 9.72, 11.11)
NOISE, OFFSET, SPEED_SD = 1.0, 0.4, 0.03

HEADER = f"""# Six headform tests on one hood, SIMULATED with mcstudy's own headform model
# (python -m scripts.example_tests); an example of the measured-data format.

format = "mcstudy-measured/1"
title = "Example hood, child headform, 6 simulated tests"
model = "headform"

[fixed]
headform_mass = 2.5

[inputs.impact_speed]
unit = "m/s"
sd = {SPEED_SD}

[signals.head_acceleration]
unit = "g"
sd = {NOISE}
filter = "none"
"""


def main() -> None:
    """Write the folder."""
    rng = np.random.default_rng(20)
    corridor = load_corridors("working_curves")["hood"]
    (FOLDER / "signals").mkdir(parents=True, exist_ok=True)
    rows = []
    for k, speed in enumerate(SPEEDS):
        curve = corridor.curve(float(rng.beta(4.0, 4.0)))
        model = load_model("headform", {"hood_curve": curve.knots, "channel_class": 0.0})
        true_speed = speed + SPEED_SD * float(rng.standard_normal())
        run = model.run({"impact_speed": true_speed, "hood_unloading_ratio": 7.0})
        head = run.histories["head"]
        # The laboratory samples at 10 kHz, every second sample of the model.
        time, values = head.time[::2], head.channels["acceleration"][::2]
        measured = values + OFFSET + NOISE * rng.standard_normal(values.size)
        name = f"H{k + 1:02d}"
        frame = pd.DataFrame({"time": np.round(time, 6), "head_acceleration": measured.round(3)})
        frame.to_csv(FOLDER / "signals" / f"{name}.csv", index=False)
        rows.append({"test": name, "impact_speed": speed})
    pd.DataFrame(rows).to_csv(FOLDER / "tests.csv", index=False)
    (FOLDER / "measured.toml").write_text(HEADER, encoding="utf-8")


if __name__ == "__main__":
    main()
