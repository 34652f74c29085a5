// SPDX-License-Identifier: Apache-2.0
// The last events that the algorithms of a run reported, the newest first.

import { Refused, ask } from "./api.js";
import { element } from "./panels.js";

const CLASSES = { debug: "stale", info: "nominal", warning: "degraded", error: "failed" };

export class Events {
  #table;
  #id = null;  // null: nothing to show

  constructor(table) {
    this.#table = table;
  }

  /** Those of another run, or of none (null). */
  open(id) {
    this.#id = id;
    this.#show([]);
  }

  /** What the supervisor says of them now. A run whose machine reports none is asked once. */
  async refresh() {
    const id = this.#id;
    if (id === null) return;
    try {
      const found = await ask("GET", `/runs/${encodeURIComponent(id)}/events`);
      if (this.#id !== id) return;
      if (found.last === undefined) this.#id = null;
      this.#show(found.last ?? []);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;  // refused: the run is about to end, and the last events stay
    }
  }

  #show(events) {
    this.#table.hidden = events.length === 0;
    this.#table.tBodies[0].replaceChildren(...events.toReversed().map((event) => element("tr", {},
      element("td", { textContent: event.tick }),
      element("td", { textContent: event.severity, className: CLASSES[event.severity] ?? "" }),
      element("td", { textContent: event.instance }),
      element("td", { textContent: event.message, className: "long" }),
      element("td", { textContent: `${event.file}:${event.line}` }))));
  }
}
