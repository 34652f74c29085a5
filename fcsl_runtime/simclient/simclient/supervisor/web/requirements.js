// SPDX-License-Identifier: Apache-2.0
// The verdicts on the requirements of a run.

import { Refused, ask } from "./api.js";
import { element } from "./panels.js";

const CLASSES = { met: "nominal", violated: "failed", "not exercised": "stale" };

/** Values by path as a text. */
function shown(values) {
  return Object.entries(values).map(([path, value]) => `${path} = ${value}`).join(", ");
}

export class Requirements {
  #table;
  #id = null;  // null: nothing to show

  constructor(table) {
    this.#table = table;
  }

  /** Those of another run, or of none (null). */
  open(id) {
    this.#id = id;
    this.#show({});
  }

  /** What the supervisor says of them now. A run without requirements is asked once. */
  async refresh() {
    const id = this.#id;
    if (id === null) return;
    try {
      const found = await ask("GET", `/runs/${encodeURIComponent(id)}/requirements`);
      if (this.#id !== id) return;
      if (Object.keys(found).length === 0) this.#id = null;
      this.#show(found);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;  // refused: the run is about to end, and the last verdicts stay
    }
  }

  #show(found) {
    this.#table.hidden = Object.keys(found).length === 0;
    this.#table.tBodies[0].replaceChildren(...Object.entries(found).map(([id, verdict]) => element("tr", {},
      element("td", { textContent: id }),
      element("td", { textContent: verdict.status, className: CLASSES[verdict.status] ?? "" }),
      element("td", { textContent: verdict.exercised }),
      element("td", { textContent: verdict.violations }),
      element("td", { textContent: verdict.first_tick ?? "" }),
      element("td", { textContent: shown(verdict.first ?? {}), className: "long" }),
      element("td", { textContent: verdict.text, className: "long" }))));
  }
}
