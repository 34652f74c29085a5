// SPDX-License-Identifier: Apache-2.0
// What a run sends, as single numbers; and the panels that its machine names in `views`.

const NUMBERS_MAX = 20000;
const ROLES = ["truth", "measured", "estimate", "command", "values"];
const ANGLES = ["roll", "pitch", "yaw"];

/** Indices of an array of this shape: "", or "[0]", "[1]", ... */
function indices(shape) {
  return shape.reduce((found, extent) => found.flatMap(
    (begun) => Array.from({ length: Math.min(extent, NUMBERS_MAX) }, (_, i) => `${begun}[${i}]`)), [""]);
}

/** Every number of these channels, as curves; of very many, the first. */
export function numbersOf(channels) {
  const found = [];
  for (const [path, { shape, unit, labels }] of Object.entries(channels)) {
    for (const index of indices(shape)) {
      if (found.length === NUMBERS_MAX) return found;
      found.push({ name: path + index, unit, labels, role: "values" });
    }
  }
  return found;
}

/** Titles and curves of a machine's views. Paths that are not sent are left out, and members of another form. */
export function panelsOf(views, numbers) {
  const panels = Array.isArray(views?.panels) ? views.panels : [];
  return panels.flatMap((panel) => (panel?.angles === true ? angles(panel, numbers) : [values(panel, numbers)]))
    .filter((panel) => panel.curves.length > 0);
}

function paths(panel) {
  return ROLES.flatMap((role) => (Array.isArray(panel?.[role]) ? panel[role] : [])
    .filter((path) => typeof path === "string").map((path) => [role, path]));
}

function values(panel, numbers) {
  const below = (path) => numbers.filter(({ name }) => name === path || name.startsWith(`${path}.`) || name.startsWith(`${path}[`));
  const curves = paths(panel).flatMap(([role, path]) => below(path).map((number) => ({ ...number, role })));
  return { title: String(panel?.title ?? ""), curves };
}

function angles(panel, numbers) {
  const sent = paths(panel).filter(([, path]) => numbers.some(({ name }) => name === `${path}[3]`));
  return ANGLES.map((angle) => ({
    title: `${panel.title ?? ""}: ${angle}`,
    curves: sent.map(([role, path]) => ({ name: `${path}.${angle}`, unit: "deg", labels: [], role, quaternion: path })),
  }));
}
