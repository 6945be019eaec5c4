"""One scene (standard input) by this package: seconds of the process and of the run, the estimated
error, the end.
"""

import json
import sys
import time

from inverse_service.service.scenes.simulating import simulate

if __name__ == "__main__":
    document = json.load(sys.stdin)
    (found,) = simulate(document, time_limit=600.0)["methods"]
    end = [found["final"]["positions"][name] for name in document["system"]["coordinates"]]
    row = {"outcome": found["outcome"], "error": found.get("estimated_error"), "end": end}
    print(json.dumps(row | {"seconds": time.process_time(), "run": found["seconds"]["run"]}))
