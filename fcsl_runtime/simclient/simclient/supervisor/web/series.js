// SPDX-License-Identifier: Apache-2.0
// Series: the points of a run that the page has, on one time axis.

const KEPT_S = 60;

/** The first index whose time is not before `time`. */
export function indexAt(times, time) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low;
}

export class Series {
  session = "";
  time = [];       // s, rising
  gap = [];        // whether ticks are missing before the point
  columns = new Map();  // name -> a value for each time; null: unknown, or old
  states = [];     // [time, name], rising

  get newest() {
    return this.time.at(-1) ?? 0;
  }

  /** An update of the stream replaces all from its first time on: a checkpoint may put a machine back. */
  add(update) {
    if (update.session !== this.session) this.#clear(update.session);
    const [first] = update.time_s;
    const at = indexAt(this.time, first);
    const apart = update.first && at > 0 && at === this.time.length;  // the page was away for longer than ticks are kept
    this.#cut(0, at);
    const count = this.time.length;
    this.states = this.states.slice(0, indexAt(this.states.map(([time]) => time), first));
    for (const [name, values] of Object.entries(update.values)) {
      if (!this.columns.has(name)) this.columns.set(name, new Array(count).fill(null));
      this.columns.get(name).push(...values);
    }
    const breaks = new Set(update.breaks);
    update.time_s.forEach((time, index) => {
      this.time.push(time);
      this.gap.push(breaks.has(index) || (index === 0 && apart));
    });
    for (const [time, name] of update.states) {
      if (this.states.at(-1)?.[1] !== name) this.states.push([time, name]);
    }
    for (const column of this.columns.values()) {
      while (column.length < this.time.length) column.push(null);
    }
    if (this.time[0] < this.newest - 2 * KEPT_S) this.#forget(this.newest - KEPT_S);
  }

  #clear(session) {
    this.session = session;
    this.time = [];
    this.gap = [];
    this.columns.clear();
    this.states = [];
  }

  #cut(from, to) {
    this.time = this.time.slice(from, to);
    this.gap = this.gap.slice(from, to);
    for (const [name, column] of this.columns) this.columns.set(name, column.slice(from, to));
  }

  #forget(before) {
    this.#cut(indexAt(this.time, before), this.time.length);
    const first = indexAt(this.states.map(([time]) => time), before);
    this.states = this.states.slice(Math.max(0, first - 1));
  }
}
