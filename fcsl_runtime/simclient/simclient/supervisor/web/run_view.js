// SPDX-License-Identifier: Apache-2.0
// One run: its values to choose from, its panels, its states, its output.

import { ask } from "./api.js";
import { numbersOf, panelsOf } from "./channels.js";
import { Events } from "./events.js";
import { Panels, element } from "./panels.js";
import { drawStates } from "./plot.js";
import { Requirements } from "./requirements.js";
import { healthClass } from "./runs.js";
import { Series } from "./series.js";
import { Times } from "./times.js";

const LISTED_MAX = 200, CURVES_MAX = 64;
const RATE_S = 3;
const NO_TELEMETRY = 409;

const $ = (id) => document.getElementById(id);

export class RunView {
  id = null;
  status = "";
  #numbers = [];
  #series = new Series();
  #hz = 0;  // ticks per second
  #arrivals = [];  // of updates, ms
  #drawing = false;

  /** `onChange` is called when the stream must send other values; `onError` with an error to show. */
  constructor(onChange, onError) {
    this.onChange = onChange;
    this.onError = onError;
    this.panels = new Panels($("panels"), () => {
      this.#tick();
      onChange();
    });
    this.requirements = new Requirements($("requirements"));
    this.events = new Events($("events"));
    this.times = new Times($("times"));
    $("filter").oninput = () => this.#list();
    $("seconds").onchange = () => this.#draw();
    $("printed").ontoggle = () => this.refresh();
    new ResizeObserver(() => this.#draw()).observe($("pictures"));
  }

  /** Where the stream of this run is. */
  get path() {
    const query = new URLSearchParams();
    if (this.id !== null) query.append("run", this.id);
    const curves = this.panels.curves;
    for (const { name } of curves.filter((curve) => !curve.quaternion)) query.append("path", name);
    for (const path of new Set(curves.map((curve) => curve.quaternion).filter(Boolean))) query.append("angles", path);
    return `/stream?${query}`;
  }

  /** Shows a run, or none (null). */
  async open(id) {
    this.id = id;
    this.status = "";
    this.#numbers = [];
    this.#series = new Series();
    this.#arrivals = [];
    $("run").hidden = id === null;
    $("log").textContent = $("tick").textContent = $("time").textContent = "";
    $("instances").replaceChildren();
    this.panels.clear();
    this.requirements.open(id);
    this.events.open(id);
    this.times.open(id);
    this.#list();
    this.onChange();
    if (id === null) return;
    $("title").textContent = `Run ${id}`;
    try {
      await this.#describe(id);
    } catch (error) {
      if (this.id === id && error.status !== NO_TELEMETRY) this.onError(error);
    }
  }

  async #describe(id) {
    const at = `/runs/${encodeURIComponent(id)}`;
    const run = await ask("GET", at);
    if (this.id !== id) return;
    $("title").textContent = `Run ${id}: ${run.kind} ${run.file}`;
    $("log").textContent = run.log.join("\n");
    const sent = await ask("GET", `${at}/channels`);
    if (this.id !== id || this.#numbers.length > 0) return;
    this.#numbers = numbersOf(sent.channels);
    this.#hz = sent.tick_hz;
    for (const { title, curves } of panelsOf(run.views, this.#numbers)) {
      if (this.panels.curves.length + curves.length <= CURVES_MAX) this.panels.open(title, curves);
    }
    this.#list();
  }

  /** With what the supervisor says of the run once a second. */
  summary(run) {
    const found = Object.entries(run.health.instances ?? {}).map(([name, health]) =>
      element("li", {}, `${name}: `, element("span", { className: healthClass(health), textContent: health })));
    $("instances").replaceChildren(...found);
    if (this.#numbers.length === 0 && run.status === "running") this.#describe(this.id).catch(() => {});
    if (run.status === "running") {
      this.requirements.refresh().catch(this.onError);
      this.events.refresh().catch(this.onError);
      this.times.refresh().catch(this.onError);
    }
    if (run.status !== "ended" || run.status !== this.status) this.refresh();
    this.status = run.status;
    this.#rate();
  }

  /** The output of the program, if it is shown. */
  async refresh() {
    const id = this.id;
    if (id === null || !$("printed").open) return;
    try {
      const { log } = await ask("GET", `/runs/${encodeURIComponent(id)}`);
      const text = log.join("\n");
      if (this.id === id && $("log").textContent !== text) $("log").textContent = text;  // keeps what is selected in it
    } catch (error) {
      this.onError(error);
    }
  }

  update(update) {
    if (update.run !== this.id) return;
    this.#series.add(update);
    this.#arrivals.push(performance.now());
    $("tick").textContent = update.tick;
    $("time").textContent = `${this.#series.newest.toFixed(2)} s`;
    this.#draw();
  }

  #rate() {
    const since = performance.now() - RATE_S * 1000;
    this.#arrivals = this.#arrivals.filter((time) => time > since);
    $("rate").textContent = (this.#arrivals.length / RATE_S).toFixed(1);
  }

  /** Draws once before the next frame, however many updates came: a slow browser skips pictures, and does not fall behind. */
  #draw() {
    if (this.#drawing) return;
    this.#drawing = true;
    requestAnimationFrame(() => {
      this.#drawing = false;
      if (this.id === null) return;
      const series = this.#series, seconds = Number($("seconds").value);
      const from = Math.max(0, series.newest - seconds), to = from + seconds;
      drawStates($("band"), series, from, to);
      const violated = this.requirements.spans
        .map(({ id, first, last }) => ({ id, from: first / this.#hz, to: (last + 1) / this.#hz }))
        .filter((span) => span.to > from && span.from < to);
      this.panels.draw(series, from, to, violated);
      const state = series.states.at(-1);
      const words = [state ? `state ${state[1]} since ${state[0].toFixed(2)} s` : "state unknown",
        ...new Set(violated.map(({ id }) => `${id} violated`))];
      $("band").setAttribute("aria-label", words.join(", "));
      $("pictures").dataset.drawn = series.newest;
    });
  }

  #list() {
    const words = $("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    const fits = ({ name }) => words.every((word) => name.toLowerCase().includes(word));
    const found = this.#numbers.filter(fits);
    const rows = [];
    let group = null;
    for (const curve of found.slice(0, LISTED_MAX)) {
      const [instance] = curve.name.split(".", 1);
      if (instance !== group) rows.push(element("h3", { textContent: group = instance }));
      rows.push(this.#choice(curve));
    }
    $("values").replaceChildren(...rows);
    const more = found.length > LISTED_MAX ? `; the first ${LISTED_MAX} are shown, type more to narrow them` : "";
    $("found").textContent = `${found.length} of ${this.#numbers.length} values${more}`;
    this.#tick();
  }

  /** Ticks the listed values that are shown. */
  #tick() {
    const chosen = new Set(this.panels.curves.map((curve) => curve.name));
    for (const box of $("values").querySelectorAll("input")) {
      box.checked = chosen.has(box.value);
      box.disabled = !box.checked && chosen.size >= CURVES_MAX;
    }
    $("hint").hidden = !this.panels.isEmpty || this.#numbers.length === 0;
  }

  #choice(curve) {
    const box = element("input", { type: "checkbox", value: curve.name });
    box.onchange = () => (box.checked ? this.panels.show(curve) : this.panels.hide(curve.name));
    const rest = curve.name.slice(curve.name.indexOf(".") + 1);
    return element("label", { title: curve.name }, box, ` ${rest} `,
      element("span", { className: "unit", textContent: curve.unit && `[${curve.unit}]` }));
  }
}
