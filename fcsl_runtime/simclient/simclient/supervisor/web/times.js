// SPDX-License-Identifier: Apache-2.0
// How long the instances of a run take, the largest share of the step first, of a machine built with --times.

import { Refused, ask } from "./api.js";
import { element } from "./panels.js";

const STEP = "machine";

/** A time in ns as a text. */
function shown(ns) {
  return `${(ns / 1000).toFixed(2)} µs`;
}

export class Times {
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

  /** What the supervisor says of them now. A run that is not measured is asked once. */
  async refresh() {
    const id = this.#id;
    if (id === null) return;
    try {
      const found = await ask("GET", `/runs/${encodeURIComponent(id)}/times`);
      if (this.#id !== id) return;
      if (found[STEP] === undefined) this.#id = null;
      this.#show(found);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;  // refused: the run is about to end, and the last times stay
    }
  }

  #show(found) {
    const { [STEP]: step, ...instances } = found;
    this.#table.hidden = step === undefined;
    const rows = Object.entries(instances).sort(([, a], [, b]) => b.total_ns - a.total_ns);
    if (step !== undefined) rows.push(["step", step]);
    this.#table.tBodies[0].replaceChildren(...rows.map(([name, row]) => element("tr", {},
      element("td", { textContent: name }),
      element("td", { textContent: row.runs }),
      ...["mean_ns", "p50_ns", "p99_ns", "max_ns"].map((figure) =>
        element("td", { textContent: row.runs > 0 ? shown(row[figure]) : "" })),
      element("td", { textContent: step.total_ns > 0 ? `${(100 * row.total_ns / step.total_ns).toFixed(1)} %` : "" }))));
  }
}
