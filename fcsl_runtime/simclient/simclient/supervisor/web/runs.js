// SPDX-License-Identifier: Apache-2.0
// The table of runs, and the form that starts one.

import { ask } from "./api.js";
import { element } from "./panels.js";

const HEALTHS = new Set(["nominal", "degraded", "failed", "stale", "stalled", "unresponsive", "starting", "stopping", "ended"]);

/** The class of a health; of a word that is none, no class. */
export function healthClass(word) {
  return HEALTHS.has(word) ? word : "";
}

function cells(run) {
  const { health } = run;
  const ended = run.exit === null ? run.status : `ended: ${run.exit.status}, ${run.exit.meaning}`;
  return [
    run.id, run.kind, run.file, new Date(run.started * 1000).toLocaleString(), health.paused ? "paused" : ended,
    health.state ?? "", run.status === "ended" ? "" : health.health, health.tick ?? "",
  ];
}

export class RunTable {
  #rows = new Map();

  /** `onError` is called with what a request was refused for. */
  constructor(body, onError) {
    this.body = body;
    this.onError = onError;
  }

  show(runs, chosen) {
    const known = new Set(runs.map((run) => run.id));
    for (const [id, row] of this.#rows) {
      if (!known.has(id)) {
        row.remove();
        this.#rows.delete(id);
      }
    }
    for (const run of runs) {
      if (!this.#rows.has(run.id)) this.#make(run.id);
      const row = this.#rows.get(run.id);
      cells(run).forEach((text, index) => {
        const cell = index === 0 ? row.cells[0].firstChild : row.cells[index];
        if (cell.textContent !== String(text)) cell.textContent = text;
      });
      row.cells[6].className = healthClass(run.health.health);
      row.classList.toggle("chosen", run.id === chosen);
      row.querySelector("button").hidden = run.status === "ended";
    }
    this.body.classList.toggle("empty", runs.length === 0);
  }

  #make(id) {
    const row = element("tr");
    const stop = element("button", { type: "button", textContent: "stop" });
    stop.setAttribute("aria-label", `stop run ${id}`);
    stop.onclick = async () => {
      stop.disabled = true;
      try {
        await ask("DELETE", `/runs/${encodeURIComponent(id)}`);
      } catch (error) {
        this.onError(error);
      } finally {
        stop.disabled = false;
      }
    };
    const link = element("a", { href: `#${id}` });
    row.append(element("td", {}, link));
    for (let index = 1; index < 8; index++) row.append(element("td"));
    row.cells[2].className = row.cells[4].className = "long";
    row.append(element("td", {}, stop));
    this.#rows.set(id, row);
    this.body.prepend(row);  // the newest first
  }
}

/** The form that starts a run. `onStart` is called with the run, `onError` with what it was refused for (null: nothing). */
export function startForm(form, onStart, onError) {
  const [kind, file, options] = ["#kind", "#file", "#options"].map((id) => form.querySelector(id));
  kind.onchange = () => {
    const simulation = kind.value === "simulation";
    file.placeholder = simulation ? "lander/sim/lander.sim.json" : "libminimal_machines.so";
    options.placeholder = simulation ? '{"speed": 1}' : '{"paused": true}';
  };
  form.onsubmit = async (event) => {
    event.preventDefault();
    const button = form.querySelector("button");
    button.disabled = true;
    onError(null);
    try {
      onStart(await ask("POST", "/runs", { kind: kind.value, file: file.value, options: parsed(options.value) }));
    } catch (error) {
      onError(error);
    } finally {
      button.disabled = false;
    }
  };
}

function parsed(text) {
  try {
    return text.trim() ? JSON.parse(text) : {};
  } catch (error) {
    throw new Error(`options: write a JSON object, for example {"paused": true}: ${error.message}`);
  }
}
