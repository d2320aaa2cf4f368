"""A crash before it is simulated: pedestrian, posture, car, braking and road.

It is the same for every crash model, so that models differ only in their method.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from models.contact.road import Road
from models.crash.ellipsoids import Ellipsoids, build_ellipsoids
from models.effects.chain import EffectChain
from models.pedestrian.anthropometry import Body, build_body
from models.pedestrian.joints import Joints, build_joints
from models.pedestrian.posture import Posture, running_posture
from models.pedestrian.tissue import build_tissue
from models.vehicle.motion import CarMotion, braking_motion
from models.vehicle.profile import Vehicle, build_zones
from models.vehicle.zones import Zones

HOOD = "hood"
"""Zone whose forces ``hood_force_scale`` multiplies."""


@dataclass(frozen=True)
class Scenario:
    """Input data of a crash model.

    Attributes
    ----------
    body : Body
    vehicle : Vehicle
    joints : Joints
    ellipsoids : Ellipsoids
        Without gaps between neighbours yet; each model sets them in its own geometry.
    zones : Zones
        Geometry of the car's front.
    road : Road
    car_motion : CarMotion
    posture : Posture
        At first contact, the hips above the origin.
    lateral_offset : float
        Position of the hips to the left of the car's centre line, m.
    dive_angle : float
        Of the braking car, nose down, rad.
    """

    body: Body
    vehicle: Vehicle
    joints: Joints
    ellipsoids: Ellipsoids
    zones: Zones
    road: Road
    car_motion: CarMotion
    posture: Posture
    lateral_offset: float
    dive_angle: float


def build_scenario(
    inputs: Mapping[str, float], vehicle: Vehicle, chain: EffectChain | None = None
) -> Scenario:
    """Return the scenario for one set of inputs.

    Parameters
    ----------
    inputs : mapping of str to float
        By name, in SI units; see ``data/multibody.toml``.
    vehicle : Vehicle
    chain : EffectChain, optional
        Effects that are switched on.
    """
    chain = chain or EffectChain()
    given = inputs
    inputs = chain.act("inputs", given, given)
    body = build_body(inputs["age"], inputs["stature"], inputs["body_mass"], inputs["head_mass"])
    curves = [zone.corridor.curve(inputs[zone.coordinate]) for zone in vehicle.zones]
    for k, zone in enumerate(vehicle.zones):
        if zone.name == HOOD:
            force = inputs["hood_force_scale"] * curves[k].force
            curves[k] = chain.act("curve", replace(curves[k], force=force), given)
    tissue = build_tissue(body)
    tissue["head"] = tissue["head"].scaled(force=inputs["head_stiffness"])
    road = chain.act("road", Road(inputs["friction_body_road"]), given)
    posture = running_posture(
        body,
        gait_phase=inputs["gait_phase"],
        facing_angle=inputs["facing_angle"],
        running_speed=inputs["running_speed"],
        braced=chain.act("posture", 0.0, given),
    )
    return Scenario(
        body=body,
        vehicle=vehicle,
        joints=build_joints(
            body,
            neck_stiffness=inputs["neck_stiffness"],
            muscle_tone=inputs["muscle_tone"],
            neck_tension_stiffness=inputs["neck_tension_stiffness"],
            shoulder_stiffness=inputs["shoulder_stiffness"],
        ),
        ellipsoids=build_ellipsoids(body, tissue, curves, road.returned),
        zones=build_zones(
            vehicle, inputs["dive_angle"], inputs["friction_body_car"], inputs["ploughing"]
        ),
        road=road,
        car_motion=chain.act(
            "braking",
            braking_motion(
                inputs["impact_speed"],
                inputs["friction_tyre_road"],
                inputs["yaw_rate"],
                vehicle.rotation_centre,
                road.gravity_along,
            ),
            given,
        ),
        posture=posture,
        lateral_offset=inputs["lateral_offset"],
        dive_angle=inputs["dive_angle"],
    )
