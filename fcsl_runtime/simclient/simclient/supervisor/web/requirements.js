// SPDX-License-Identifier: Apache-2.0
// The verdicts on the requirements of a run, and the ticks in which they were violated.

import { Refused, ask } from "./api.js";
import { element } from "./panels.js";

const SPANS_MAX = 256;
const CLASSES = { met: "nominal", violated: "failed", "not exercised": "stale" };

/** Values by path as a text. */
function shown(values) {
  return Object.entries(values).map(([path, value]) => `${path} = ${value}`).join(", ");
}

/**
 * The ticks that are known to violate a requirement, of two verdicts on it: null if none did, else the first and the last.
 * `continues`: they are of the violation that was there before. Of several that have begun, the last tick alone is known.
 */
export function violatedTicks(before, now) {
  const ticks = now.violated_ticks - before.violated_ticks, begun = now.violations - before.violations;
  if (ticks <= 0 || begun < 0) return null;
  const last = now.last_tick;
  return { first: begun <= 1 ? Math.max(0, last - ticks + 1) : last, last, continues: begun === 0 };
}

export class Requirements {
  spans = [];  // {id, first, last}: ticks of violations
  #table;
  #id = null;  // null: nothing to show
  #before = {};

  constructor(table) {
    this.#table = table;
  }

  /** Those of another run, or of none (null). */
  open(id) {
    this.#id = id;
    this.#before = {};
    this.spans = [];
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
      for (const [name, verdict] of Object.entries(found)) this.#remember(name, verdict);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;  // refused: the run is about to end, and the last verdicts stay
    }
  }

  #remember(id, verdict) {
    const found = violatedTicks(this.#before[id] ?? { violations: 0, violated_ticks: 0 }, verdict);
    this.#before[id] = verdict;
    const open = this.spans.findLast((span) => span.id === id);
    if (found === null) return;
    if (found.continues && open) open.last = found.last;
    else this.spans.push({ id, first: found.first, last: found.last });
    this.spans.splice(0, this.spans.length - SPANS_MAX);
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
