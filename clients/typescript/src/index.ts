// The client: `fetch` with the types of the service's description, which `npm run generate` reads.
import createFetchClient, { type Client, type ClientOptions } from "openapi-fetch";

import type { components, paths } from "./description.js";

export type { components, paths };
export type SystemDocument = components["schemas"]["SystemDocument"];
export type ResultDocument = components["schemas"]["ResultDocument"];

/** A client of the service at `options.baseUrl`. */
export function createClient(options: ClientOptions): Client<paths> {
  return createFetchClient<paths>(options);
}
