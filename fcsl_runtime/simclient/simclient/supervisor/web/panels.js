// SPDX-License-Identifier: Apache-2.0
// Panels: which curves are shown where, their legends, and their pictures.

import { COLORS, drawCurves } from "./plot.js";

const CURVES_MAX = 8;
const TRUTH_COLOR = "#111";

/** An element with properties and children. Texts become text, never HTML. */
export function element(tag, properties = {}, ...children) {
  const found = Object.assign(document.createElement(tag), properties);
  found.append(...children);
  return found;
}

/** A value with 5 digits, or its name; a request that is none has an empty one. */
function shortest(value, labels) {
  return labels.length > value && value >= 0 ? labels[value] || "–" : Number(value.toPrecision(5)).toString();
}

/** A path, which a narrow legend breaks after its dots. */
function breakable(path) {
  return path.split(/(?<=\.)/).flatMap((part) => [part, document.createElement("wbr")]);
}

class Panel {
  constructor(title, unit, onRemove) {
    this.title = title;
    this.unit = unit;
    this.curves = [];
    this.canvas = element("canvas");
    this.canvas.setAttribute("role", "img");
    this.legend = element("ul", { className: "legend" });
    const name = [title, unit ? `[${unit}]` : title ? "" : "no unit"].join(" ").trim();
    const close = element("button", { className: "remove", type: "button", textContent: "close", onclick: onRemove });
    this.figure = element("figure", { className: "panel" },
      element("figcaption", {}, element("span", { textContent: name }), close),
      element("div", { className: "plot" }, this.canvas, this.legend));
    this.canvas.setAttribute("aria-label", name);
  }

  add(curve, onRemove) {
    const color = curve.role === "truth" ? TRUTH_COLOR : COLORS.find((one) => this.curves.every((c) => c.color !== one));
    const value = element("output");
    const swatch = element("span", { className: `swatch ${curve.role}` });
    swatch.style.color = color;
    const remove = element("button", { className: "remove", type: "button", textContent: "×", onclick: onRemove });
    remove.setAttribute("aria-label", `remove ${curve.name}`);
    const row = element("li", {}, swatch,
      element("span", { className: "name", title: curve.role }, ...breakable(curve.name)), value, remove);
    this.legend.append(row);
    this.curves.push({ ...curve, color, value, row });
  }

  remove(name) {
    this.curves.find((curve) => curve.name === name)?.row.remove();
    this.curves = this.curves.filter((curve) => curve.name !== name);
  }

  draw(series, from, to, violated) {
    drawCurves(this.canvas, series, this.curves, from, to, violated);
    for (const curve of this.curves) {
      const value = series.columns.get(curve.name)?.at(-1) ?? null;
      curve.value.textContent = value === null ? "–" : shortest(value, curve.labels);
    }
  }
}

/** All panels of a run. A curve: `name` as the stream calls it, `unit`, `role`. A name is shown once at most in a panel. */
export class Panels {
  #panels = [];

  /** `onChange` is called when other values are wanted than before. */
  constructor(parent, onChange) {
    this.parent = parent;
    this.onChange = onChange;
  }

  /** All shown curves, each once. */
  get curves() {
    const all = this.#panels.flatMap((panel) => panel.curves);
    return [...new Map(all.map((curve) => [curve.name, curve])).values()];
  }

  get isEmpty() {
    return this.#panels.length === 0;
  }

  clear() {
    this.#panels = [];
    this.parent.replaceChildren();
  }

  /** A panel of its own, of the first curves that it has room for. */
  open(title, curves) {
    const panel = this.#make(title, curves[0]?.unit ?? "");
    for (const curve of curves.slice(0, CURVES_MAX)) this.#add(panel, curve);
    this.onChange();
  }

  /** Into the last panel that was opened for curves of this unit, if it has room. */
  show(curve) {
    const fits = (panel) => panel.title === "" && panel.unit === curve.unit && panel.curves.length < CURVES_MAX;
    this.#add(this.#panels.findLast(fits) ?? this.#make("", curve.unit), curve);
    this.onChange();
  }

  hide(name) {
    for (const panel of [...this.#panels]) {
      panel.remove(name);
      if (panel.curves.length === 0) this.#close(panel);
    }
    this.onChange();
  }

  draw(series, from, to, violated) {
    for (const panel of this.#panels) panel.draw(series, from, to, violated);
  }

  #make(title, unit) {
    const panel = new Panel(title, unit, () => {
      this.#close(panel);
      this.onChange();
    });
    this.#panels.push(panel);
    this.parent.append(panel.figure);
    return panel;
  }

  #add(panel, curve) {
    panel.add(curve, () => {
      panel.remove(curve.name);
      if (panel.curves.length === 0) this.#close(panel);
      this.onChange();
    });
  }

  #close(panel) {
    panel.figure.remove();
    this.#panels = this.#panels.filter((one) => one !== panel);
  }
}
