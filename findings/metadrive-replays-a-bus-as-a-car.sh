#!/usr/bin/env bash
# Expected: a scenario description has length, width and height of each vehicle at each step, and MetaDrive replays it: a bus
#   of 12 m that drives at 10 m/s towards a truck of 9 m with a gap of 29.5 m between them, which drives 2 m/s, meets it after 3.7 s.
# Happens: the bus is a body of 4.51 m x 1.85 m and the truck one of 5.74 m x 2.30 m: the engine takes one of its own models, by
#   default for the ego and by length for others. The two never meet within the four seconds, and `crash_vehicle` stays
#   false. With `use_bounding_box` both have their sizes and the contact is there.
# Version: metadrive-simulator 0.4.3 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q metadrive-simulator==0.4.3
cd "$folder"
cat > find.py <<'PY'
import logging
import pickle
from importlib.metadata import version
from pathlib import Path

import metadrive
import numpy as np

# The engine fetches pictures and models at its first start; without a window it needs none, but looks for two files.
assets = Path(metadrive.__file__).parent / "assets"
(assets / "textures" / "grass1").mkdir(parents=True)
(assets / "version.txt").write_text(version("metadrive-simulator"))
(assets / "textures" / "grass1" / "GroundGrassGreen002_COL_1K.jpg").touch()

from metadrive.envs.scenario_env import ScenarioEnv
from metadrive.policy.replay_policy import ReplayEgoCarPolicy
from metadrive.scenario.scenario_description import ScenarioDescription

STEPS = np.arange(41)
ONES = np.ones(len(STEPS))


def track(name, x_m, speed, size_m):
    length_m, width_m, height_m = size_m
    state = {
        "position": np.stack([x_m + 0.1 * speed * STEPS, 0 * ONES, 0 * ONES], axis=1),
        "velocity": np.stack([speed * ONES, 0 * ONES], axis=1),
        "heading": 0 * ONES,
        "valid": STEPS >= 0,
        "length": length_m * ONES,
        "width": width_m * ONES,
        "height": height_m * ONES,
    }
    about = {"type": "VEHICLE", "object_id": name, "track_length": len(STEPS)}
    return {"type": "VEHICLE", "state": state, "metadata": about}


def write(folder):
    edge = np.array([[-50.0, 1.75], [150.0, 1.75], [150.0, -1.75], [-50.0, -1.75]])
    lane = {"type": "LANE_SURFACE_STREET", "polyline": np.array([[-50.0, 0, 0], [150.0, 0, 0]]), "polygon": edge}
    links = dict.fromkeys(("entry_lanes", "exit_lanes", "left_neighbor", "right_neighbor"), [])
    scenario = {
        "id": "bus",
        "version": "1",
        "length": len(STEPS),
        "tracks": {"bus": track("bus", 0.0, 10.0, (12.0, 2.5, 3.0)), "truck": track("truck", 40.0, 2.0, (9.0, 2.5, 3.0))},
        "dynamic_map_states": {},
        "map_features": {"1": lane | links},
        "metadata": {"ts": 0.1 * STEPS, "sdc_id": "bus", "coordinate": "metadrive", "metadrive_processed": False}
        | {"id": "bus", "scenario_id": "bus", "dataset": "own", "number_summary": {}, "object_summary": {}},
    }
    ScenarioDescription.sanity_check(ScenarioDescription(scenario))
    folder.mkdir()
    (folder / "sd_own_1_bus.pkl").write_bytes(pickle.dumps(scenario))
    (folder / "dataset_summary.pkl").write_bytes(pickle.dumps({"sd_own_1_bus.pkl": scenario["metadata"]}))
    (folder / "dataset_mapping.pkl").write_bytes(pickle.dumps({"sd_own_1_bus.pkl": ""}))


def replayed(folder, **options):
    """Return the sizes of both bodies, and the time of the first contact in seconds."""
    env = ScenarioEnv(
        {
            "data_directory": str(folder.resolve()),
            "num_scenarios": 1,
            "agent_policy": ReplayEgoCarPolicy,
            "use_render": False,
            "log_level": logging.ERROR,
            "crash_vehicle_done": False,
            **options,
        }
    )
    env.reset(seed=0)
    bodies = env.engine.get_objects(lambda each: hasattr(each, "LENGTH")).values()
    sizes = sorted((round(float(each.LENGTH), 2), round(float(each.WIDTH), 2)) for each in bodies)
    contact_s = None
    for step in STEPS[1:]:
        _, _, terminated, truncated, said = env.step([0, 0])
        if said["crash_vehicle"]:
            contact_s = round(0.1 * float(step), 1)
        if said["crash_vehicle"] or terminated or truncated:
            break
    env.close()
    return sizes, contact_s


write(Path("data"))
print("metadrive-simulator", version("metadrive-simulator"))
default, boxes = replayed(Path("data")), replayed(Path("data"), use_bounding_box=True)
print("sizes of truck and bus in m, and contact in s:", default)
print("the same with use_bounding_box:               ", boxes)
assert default == ([(4.51, 1.85), (5.74, 2.3)], None), default
assert boxes == ([(9.0, 2.5), (12.0, 2.5)], 3.7), boxes
print("the bus is a car of 4.51 m, and does not meet the truck")
PY
venv/bin/python -W ignore find.py 2> /dev/null | grep -v '^\[INFO\]'
