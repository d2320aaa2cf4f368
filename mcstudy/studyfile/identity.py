"""Identity of a study: everything that changes the numbers of a run."""

import hashlib
import json

from mcstudy.simulator import Simulator
from mcstudy.studyfile.schema import SampledStudy


def numbers_digest(study: SampledStudy, model: Simulator) -> dict[str, str]:
    """Return the settings that change the numbers of a study, by topic, as canonical JSON.

    Two studies whose digests are equal give the same row for the same run id; n is left out
    because a larger design begins with the smaller one.
    """
    table = study.model_dump(mode="json")
    topics = {
        "model": [table["model"], model.version],
        "seed": table["seed"],
        "dependence": table["dependence"],
        "inputs": list(table["inputs"]),
    }
    topics |= study.design_topics()
    topics |= {f"inputs.{name}": entry for name, entry in table["inputs"].items()}
    topics |= {f"fixed.{name}": entry for name, entry in table["fixed"].items()}
    topics |= {f"effects.{name}": entry for name, entry in table["effects"].items()}
    return {key: json.dumps(value, sort_keys=True) for key, value in topics.items()}


def hash_of(topics: dict[str, str]) -> str:
    """Return the hash of ``numbers_digest``."""
    return hashlib.sha256(json.dumps(topics, sort_keys=True).encode()).hexdigest()
