// SPDX-License-Identifier: Apache-2.0
// Drawing on canvases: curves over time with axes, and the band of states. All share the same left and right margin.

import { indexAt } from "./series.js";

export const COLORS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b58900", "#56b4e9", "#7a5195", "#8c564b"];
const LEFT = 64, RIGHT = 8, TOP = 6, BOTTOM = 20;
const GRID = "#e4e7ea", INK = "#5b6570", FONT = "11px system-ui, sans-serif";
const VIOLATED_FILL = "#fbdcda", VIOLATED_INK = "#b3201f";
const STATE_FILLS = ["#cfe3f5", "#fbe0c8", "#cdeadd", "#f4dbe9", "#f7ecc4", "#e2dcf0", "#e6d9d5", "#dde2e6"];

/** The canvas' context in CSS pixels, cleared, and its size. */
function begin(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas;
  const scale = window.devicePixelRatio || 1;
  const size = [Math.round(width * scale), Math.round(height * scale)];
  if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = FONT;
  return { context, width, height };
}

/** Round values between two others, about `count`. */
function ticks(low, high, count) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= rough) ?? 10 * power;
  const digits = Math.min(12, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  const found = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + step * 1e-9 && found.length <= 2 * count; n++) {
    found.push([n * step, label(n * step, digits)]);
  }
  return found;
}

function label(value, digits) {
  const large = Math.abs(value) >= 1e6 || (digits > 6 && value !== 0);
  return large ? value.toExponential(2) : value.toFixed(digits);
}

/** The extent of the shown values, with some room; null if there are none. */
function extent(columns, from) {
  let low = Infinity, high = -Infinity;
  for (const column of columns) {
    for (let i = from; i < column.length; i++) {
      const value = column[i];
      if (value === null) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (low > high) return null;
  const room = (high - low) * 0.06 || Math.abs(high) * 0.1 || 1;
  return [low - room, high + room];
}

/**
 * Curves of a series, from `from` to `to` s. `curves`: name, color, role. `violated`: id of a requirement, and the time in
 * which it was violated. Values that are unknown, and ticks that are missing, leave a gap.
 */
export function drawCurves(canvas, series, curves, from, to, violated) {
  const { context, width, height } = begin(canvas);
  const first = Math.max(0, indexAt(series.time, from) - 1);
  const shown = curves.map((curve) => series.columns.get(curve.name) ?? []);
  const [low, high] = extent(shown, first) ?? [0, 1];
  const x = (time) => LEFT + ((time - from) / (to - from)) * (width - LEFT - RIGHT);
  const y = (value) => TOP + ((high - value) / (high - low)) * (height - TOP - BOTTOM);
  drawViolated(context, violated, x, width, height);
  drawAxes(context, { width, height, x, y, from, to, low, high });
  context.save();
  context.beginPath();
  context.rect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
  context.clip();
  const order = [...curves.keys()].sort((a, b) => (curves[a].role === "truth") - (curves[b].role === "truth"));
  for (const index of order) {
    context.strokeStyle = context.fillStyle = curves[index].color;
    if (curves[index].role === "measured") drawDots(context, series, shown[index], first, x, y);
    else drawLine(context, series, shown[index], first, x, y, curves[index].role);
  }
  context.restore();
}

/** A band for each violation, at least a pixel wide, with the id where it begins. */
function drawViolated(context, violated, x, width, height) {
  context.textBaseline = "top";
  context.textAlign = "left";
  for (const { id, from, to } of violated) {
    const [left, right] = [Math.floor(Math.max(x(from), LEFT)), Math.min(x(to), width - RIGHT)];
    context.fillStyle = VIOLATED_FILL;
    context.fillRect(left, TOP, Math.max(1, right - left), height - TOP - BOTTOM);
    context.fillStyle = VIOLATED_INK;
    context.fillText(id, left + 2, TOP + 2);
  }
}

function drawAxes(context, { width, height, x, y, from, to, low, high }) {
  context.strokeStyle = GRID;
  context.fillStyle = INK;
  context.lineWidth = 1;
  context.beginPath();
  context.textBaseline = "middle";
  context.textAlign = "right";
  for (const [value, text] of ticks(low, high, 5)) {
    context.moveTo(LEFT, Math.round(y(value)) + 0.5);
    context.lineTo(width - RIGHT, Math.round(y(value)) + 0.5);
    context.fillText(text, LEFT - 6, y(value));
  }
  context.textBaseline = "top";
  context.textAlign = "center";
  for (const [time, text] of ticks(from, to, width / 110)) {
    context.moveTo(Math.round(x(time)) + 0.5, TOP);
    context.lineTo(Math.round(x(time)) + 0.5, height - BOTTOM);
    context.fillText(`${text} s`, Math.min(x(time), width - RIGHT - 12), height - BOTTOM + 5);
  }
  context.stroke();
}

/** Points in one column of pixels become its first, least, greatest and last one: no more is visible. */
function drawLine(context, series, column, first, x, y, role) {
  context.lineWidth = role === "truth" ? 1 : 1.5;
  context.setLineDash(role === "command" ? [6, 4] : []);
  context.beginPath();
  let pixel = NaN, low = 0, high = 0, last = 0;
  const flush = () => {
    if (Number.isNaN(pixel)) return;
    if (high > low) {
      context.lineTo(pixel, low);
      context.lineTo(pixel, high);
    }
    context.lineTo(pixel, last);
    pixel = NaN;
  };
  let broken = true;
  for (let i = first; i < column.length; i++) {
    const value = column[i];
    if (value === null || series.gap[i]) {
      flush();
      broken = true;
    }
    if (value === null) continue;
    const across = Math.round(x(series.time[i]) * 2) / 2, up = y(value);
    if (broken) {
      context.moveTo(across, up);
      context.lineTo(across + 0.5, up);  // a point between two gaps is seen, too
      broken = false;
    }
    if (across !== pixel) {
      flush();
      pixel = across;
      low = high = up;
    }
    low = Math.min(low, up);
    high = Math.max(high, up);
    last = up;
  }
  flush();
  context.stroke();
  context.setLineDash([]);
}

function drawDots(context, series, column, first, x, y) {
  for (let i = first; i < column.length; i++) {
    if (column[i] !== null) context.fillRect(x(series.time[i]) - 1, y(column[i]) - 1, 2, 2);
  }
}

/** The states from `from` to `to` s, with their names where these fit; missing ticks leave a gap. */
export function drawStates(canvas, series, from, to) {
  const { context, width, height } = begin(canvas);
  const x = (time) => LEFT + ((time - from) / (to - from)) * (width - LEFT - RIGHT);
  const names = [...new Set(series.states.map(([, name]) => name))].sort();
  context.save();
  context.beginPath();
  context.rect(LEFT, 0, width - LEFT - RIGHT, height);
  context.clip();
  series.states.forEach(([time, name], index) => {
    const ends = series.states[index + 1]?.[0] ?? series.newest;
    if (ends < from) return;
    const [left, right] = [x(Math.max(time, from)), x(ends)];
    context.fillStyle = STATE_FILLS[names.indexOf(name) % STATE_FILLS.length];
    context.fillRect(left, 4, Math.max(1, right - left), height - 8);
    if (context.measureText(name).width + 10 > right - left) return;
    context.fillStyle = "#1c2229";
    context.textBaseline = "middle";
    context.fillText(name, left + 5, height / 2);
  });
  for (let i = Math.max(1, indexAt(series.time, from)); i < series.time.length; i++) {
    if (!series.gap[i]) continue;
    const [left, right] = [x(series.time[i - 1]), x(series.time[i])];
    context.clearRect(left, 0, Math.max(1, right - left), height);
  }
  context.restore();
  context.fillStyle = INK;
  context.textAlign = "right";
  context.textBaseline = "middle";
  context.fillText("state", LEFT - 6, height / 2);
  context.textAlign = "left";
}
