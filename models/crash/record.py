"""Layout of the arrays that a crash model records, and the criterion for rest."""

from enum import IntEnum

REST_SPEED = 0.05
"""Speed (m/s) of the centre of gravity below which the body counts as at rest (assumed; at 0.6 g
it would slide 0.2 mm further)."""
REST_SPREAD = 0.3
"""Root mean square segment speed (m/s) that a body at rest may still have (assumed)."""
REST_TIME = 0.03
"""Time (s) for which both must hold (assumed)."""


class EndReason(IntEnum):
    """Why a run ended."""

    REST_ON_ROAD = 0
    REST_ON_CAR = 1
    TIME_LIMIT = 2
    STEP_LIMIT = 3
    NOT_FINITE = 4


END_REASONS = tuple(reason.name.lower() for reason in EndReason)
GOES_ON = -1
"""Value in place of a reason while the run has not ended."""


class Column(IntEnum):
    """First columns of a row of the record; the number of columns in brackets."""

    TIME = 0
    """(1) s."""
    ACCELERATION = 1
    """(3) of the head, specific force, world axes, m/s2."""
    SPIN = 4
    """(3) head angular velocity, own axes, rad/s."""
    SPIN_RATE = 7
    """(3) head angular acceleration, own axes, rad/s2."""
    RELATIVE_VELOCITY = 10
    """(3) of the head relative to the car, car axes, m/s."""
    HEAD_CAR_FORCE = 13
    """(1) of the car on the head, N."""
    HEAD_ROAD_FORCE = 14
    """(1) of the road on the head, N."""
    CENTRE = 15
    """(3) centre of gravity, m."""
    REGION_FORCE = 18
    """(regions + 1) normal force by region of the car's front, last the road, N."""


class Summary(IntEnum):
    """Entries of the summary of a run."""

    END_REASON = 0
    TIME = 1
    STEPS = 2
    RECORDS = 3
    FRAMES = 4
    GROUND_TIME = 5
    ENERGY_AT_START = 6
    ENERGY_AT_END = 7
    HEAD_REGION = 8
    HEAD_DEPTH = 9
    CENTRE_SPEED = 10


class HeadContact(IntEnum):
    """First entries of the head's contact with the car, all in the car's frame."""

    TIME = 0
    """(1) s of first contact, NaN without any."""
    VELOCITY = 1
    """(3) m/s, relative to the car, at the first impact."""
    NORMAL = 4
    """(3) at first contact."""
    POINT = 7
    """(3) m, deepest point at the deepest contact."""


class Frame(IntEnum):
    """First columns of a frame."""

    TIME = 0
    CAR = 1
    """(3) x, y, yaw of the car's frame, m and rad."""
    POSES = 4
    """(SEGMENT_ENTRIES n) entries ``SegmentFrame`` of each segment."""


class SegmentFrame(IntEnum):
    """First entries of a segment in a frame."""

    CENTRE = 0
    """(3) of the ellipsoid, m."""
    ORIENTATION = 3
    """(4) quaternion."""
    CAR_FORCE = 7
    """(3) of the car on the segment, world axes, N."""
    CAR_TORQUE = 10
    """(3) of that force about the ellipsoid's centre, world axes, N m."""
    ROAD_FORCE = 13
    """(1) normal force of the road, N."""


class Blow(IntEnum):
    """Entries of the head's last impact on an arm."""

    START = 0
    VELOCITY = 1
    """(3) m/s, relative to the car, at its start."""
    LAST = 4
    PEAK = 5


SEGMENT_ENTRIES = SegmentFrame.ROAD_FORCE + 1
"""Number of entries of ``SegmentFrame``."""
HEAD_CONTACT_ENTRIES = HeadContact.POINT + 3
"""Number of entries of ``HeadContact``."""
BLOW_ENTRIES = Blow.PEAK + 1
"""Number of entries of ``Blow``."""
