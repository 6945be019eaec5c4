import createClient from "openapi-fetch";
import type { paths } from "./schema";
type Json = "application/json" | "application/problem+json";
const client = createClient<paths, Json>({ baseUrl: "ADDRESS", headers: { Accept: "application/json" } });
function expect(holds: boolean, what: string) { if (!holds) throw new Error(what); }
const pause = () => new Promise((resolve) => setTimeout(resolve, 100));
async function calls() {
  const oscillator = { equations: "x'' = -x" };
  const solved = await client.POST("/v1/solve", {
    body: { ...oscillator, id: 1, options: { time_limit: 5 } }, params: { header: { Prefer: "wait=20" } } });
  expect(!!solved.data && "verdict" in solved.data && solved.data.verdict === "variational", "solve");
  expect(!!solved.data && "document_id" in solved.data && solved.data.document_id === 1, "echo");
  const refused = await client.POST("/v1/parse", { body: { equations: "x'' = -kx" } });
  expect(refused.error?.errors?.[0]?.instead?.[0] === "k*x", "parse");
  const checked = await client.POST("/v1/check", { body: { system: oscillator, lagrangian: "x'^2/2 - x^2/2" } });
  expect(checked.data?.verdict === "valid", "check");
  const asked = await client.POST("/v1/solve", {
    body: { equations: { x: "-k*x" }, parameters: { k: 2 } }, params: { header: { Prefer: "respond-async" } } });
  const stored: string = asked.data && "id" in asked.data ? asked.data.id : ""; // only a job has an id
  expect(stored.length === 40, "accepted");
  const id = asked.response.headers.get("location")?.split("/").pop() ?? "";
  let job = await client.GET("/v1/jobs/{id}", { params: { path: { id } } });
  while (job.data?.status === "accepted" || job.data?.status === "running") {
    await pause();
    job = await client.GET("/v1/jobs/{id}", { params: { path: { id } } });
  }
  const found = job.data?.result;
  expect(found?.format === "inverse-service/result/1" && found.verdict === "variational", "job");
  const batch = await client.POST("/v1/batches", { body: [{ ...oscillator, id: "a" }, { equations: "x'' = 0" }, 3] });
  expect(batch.data?.total === 3, "batch");
  const lines = await client.GET("/v1/batches/{id}/results", { params: { path: { id: batch.data?.id ?? "" } } });
  expect(Array.isArray(lines.data) && lines.data.length === 3, "results");
  const initial = { positions: { x: 1 }, velocities: { x: 0 } };
  const scene = { system: { catalogue: "sho" }, initial, step: 0.1, steps: 10, methods: ["runge-kutta" as const] };
  const run = await client.POST("/v1/simulate", { body: scene, params: { header: { Prefer: "wait=20" } } });
  expect(!!run.data && "methods" in run.data && run.data.methods[0].outcome === "completed", "simulate");
  expect((await client.GET("/v1/limits")).response.ok && (await client.GET("/v1/catalogue")).response.ok, "lists");
}
calls();
