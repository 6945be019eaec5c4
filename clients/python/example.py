"""Five calls by the generated client: `python example.py http://127.0.0.1:8000`."""

import json
import sys
import time

from inverse_service_client import Client
from inverse_service_client.api.batches import batch as batch_of, create, results
from inverse_service_client.api.jobs import job
from inverse_service_client.api.simulations import simulate
from inverse_service_client.api.systems import check, solve
from inverse_service_client.models import Job, ResultDocument, SceneDocument, SystemDocument


def main(address: str) -> None:
    """Solve, check, ask without waiting, simulate, and a batch of two."""
    # Results of batches come as NDJSON to whoever does not ask for JSON.
    client = Client(
        address, headers={"Accept": "application/json"}, raise_on_unexpected_status=True
    )
    damped = SystemDocument.from_dict({"equations": "x'' = -x - c*x'", "parameters": ["c"]})

    answer = solve.sync(client=client, body=damped, prefer="wait=20")
    assert isinstance(answer, ResultDocument)
    print("solve", answer.verdict, answer.to_dict()["answers"][0]["lagrangian"]["text"])

    checked = check.sync(client=client, body=answer)
    print("check", checked.to_dict()["verdict"] if checked is not None else None)

    asked = solve.sync(
        client=client,
        body=SystemDocument.from_dict({"equations": "x'' = -x; y'' = -y - x'"}),
        prefer="respond-async",
    )
    while isinstance(asked, Job) and asked.status in ("accepted", "running"):
        time.sleep(0.1)
        asked = job.sync(asked.id, client=client)
    found = asked.result if isinstance(asked, Job) else asked
    print("job", found.verdict if isinstance(found, ResultDocument) else found)

    scene = SceneDocument.from_dict(
        {
            "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"},
            "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
            "methods": ["adaptive"],
            "step": 0.01,
            "time": 1,
        }
    )
    run = simulate.sync_detailed(client=client, body=scene, prefer="wait=20")
    print("simulate", json.loads(run.content)["methods"][0]["outcome"])

    lines = [SystemDocument.from_dict({"equations": f"x'' = -{k}*x", "id": str(k)}) for k in "12"]
    batch = create.sync(client=client, body=lines)
    assert batch is not None
    while getattr(batch_of.sync(batch.id, client=client), "status", "") != "successful":
        time.sleep(0.1)
    answers = results.sync(batch.id, client=client)
    assert isinstance(answers, list)
    print("batch", [answer.to_dict()["verdict"] for answer in answers])


main(sys.argv[1])
