"""What a crash model writes down while it steps, and when a body counts as at rest."""

REST, REST_ON_CAR, TIME_LIMIT, STEP_LIMIT, NOT_FINITE = range(5)
END_REASONS = ("rest_on_road", "rest_on_car", "time_limit", "step_limit", "not_finite")

REST_SPEED = 0.05
"""Speed (m/s) of the centre of gravity below which the body counts as at rest (assumed; at 0.6 g
it would slide 0.2 mm further)."""
REST_SPREAD = 0.3
"""Root mean square segment speed (m/s) that a body at rest may still have (assumed)."""
REST_TIME = 0.03
"""Time (s) for which both must hold (assumed)."""

# Columns of the record.
R_TIME = 0
R_ACCELERATION = 1  # 3: head, specific force, world, m/s2
R_SPIN = 4  # 3: head angular velocity, own axes, rad/s
R_SPIN_RATE = 7  # 3: head angular acceleration, own axes, rad/s2
R_RELATIVE = 10  # 3: head velocity relative to the car front, car axes, m/s
R_HEAD_CAR = 13  # head contact force with the car, N
R_HEAD_ROAD = 14
R_CENTRE = 15  # 3: centre of gravity, m
R_ZONES = 18  # z + 1: normal force by zone, last the road, N

# Entries of the summary.
(
    S_REASON,
    S_TIME,
    S_STEPS,
    S_RECORDS,
    S_FRAMES,
    S_GROUND_TIME,
    S_ENERGY_START,
    S_ENERGY_END,
    S_HEAD_ZONE,
    S_HEAD_DEPTH,
    S_CENTRE_SPEED,
) = range(11)
SUMMARY = 11
