"""A scene of bodies (standard input) by REBOUND: IAS15 of order 15 with steps of its own."""

import json
import sys
import time

import rebound

if __name__ == "__main__":
    document = json.load(sys.stdin)
    names, start = document["system"]["coordinates"], document["initial"]
    if not {"x1", "y1", "z1"} <= {*names}:
        raise SystemExit("REBOUND moves bodies only.")
    simulation = rebound.Simulation()
    mass = float(document["parameters"]["m"])
    for k in range(0, len(names), 3):
        place, speed = (
            [float(start[part][name]) for name in names[k : k + 3]]
            for part in ("positions", "velocities")
        )
        simulation.add(
            m=mass, **dict(zip(("x", "y", "z", "vx", "vy", "vz"), place + speed, strict=True))
        )
    begun = time.process_time()
    simulation.integrate(float(document["time"]))
    run = time.process_time() - begun
    end = [x for body in simulation.particles for x in (body.x, body.y, body.z)]
    print(json.dumps({"seconds": time.process_time(), "run": run, "end": end}))
