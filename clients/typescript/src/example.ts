// Five calls: `node dist/example.js http://127.0.0.1:8000`.
import { createClient } from "./index.js";

const client = createClient({ baseUrl: process.argv[2] ?? "http://127.0.0.1:8000" });

function ofAnswer<T>(answer: { data?: T; error?: unknown }): T {
  if (answer.data === undefined) throw new Error(JSON.stringify(answer.error));
  return answer.data;
}

const solved = ofAnswer(
  await client.POST("/v1/solve", {
    body: { equations: "x'' = -x - c*x'", parameters: ["c"] },
    params: { header: { Prefer: "wait=20" } },
  }),
);
if (!("verdict" in solved)) throw new Error("no result");
console.log("solve", solved.verdict);

const checked = ofAnswer(await client.POST("/v1/check", { body: solved }));
console.log("check", checked.verdict);

let job = ofAnswer(
  await client.POST("/v1/solve", {
    body: { equations: "x'' = -x; y'' = -y - x'" },
    params: { header: { Prefer: "respond-async" } },
  }),
);
while ("status" in job && (job.status === "accepted" || job.status === "running")) {
  await new Promise((resolve) => setTimeout(resolve, 100));
  job = ofAnswer(await client.GET("/v1/jobs/{id}", { params: { path: { id: job.id } } }));
}
const answer = "result" in job ? job.result : job;
console.log("job", answer && "verdict" in answer ? answer.verdict : "open");

const run = ofAnswer(
  await client.POST("/v1/simulate", {
    body: {
      system: { coordinates: ["x"], lagrangian: "x'^2/2 - x^2/2" },
      initial: { positions: { x: 1 }, velocities: { x: 0 } },
      methods: ["adaptive"],
      step: 0.01,
      time: 1,
    },
    params: { header: { Prefer: "wait=20" } },
  }),
);
if (!("methods" in run)) throw new Error("still under way");
console.log("simulate", run.methods[0]?.outcome);

const batch = ofAnswer(
  await client.POST("/v1/batches", {
    body: ["1", "2"].map((id) => ({ id, equations: `x'' = -${id}*x` })),
  }),
);
let lines: string[] = [];
while (lines.length < 2) {
  const { data } = await client.GET("/v1/batches/{id}/results", {
    params: { path: { id: batch.id } },
    parseAs: "text",
  });
  lines = String(data).split("\n").filter((line) => line !== "");
  await new Promise((resolve) => setTimeout(resolve, 100));
}
console.log("batch", lines.map((line) => JSON.parse(line).id).sort());
