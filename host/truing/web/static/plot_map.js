// Draws a map in a panel of the plot: rows down, time across, a colour for every cell; a dot marks what stands out.
// A map: {rows, edges, values, marked, high, scale: [[share, colour]], name}; edges are of all rows, s.

const TEXT = "#94a1b2", ROOM = 26; // letters of a row's name

export function short(name) { return name.length > ROOM ? `${name.slice(0, ROOM - 1)}…` : name; }

// Room for the rows' names at the left of all panels.
export function namesWidth(panels) {
  const letters = panels.flatMap((panel) => (panel.map?.rows ?? []).map((name) => short(name).length));
  return letters.length ? 24 + 6.4 * Math.max(...letters) : 0;
}

export function columnAt(map, t) {
  let k = map.edges.findIndex((edge) => edge > t) - 1;
  if (k < -1) k = map.edges.length - 2; // beyond the last edge
  return Math.max(0, k);
}

export function colour(map, value) {
  const at = Math.min(1, Math.max(0, value / map.high)), k = Math.max(1, map.scale.findIndex(([share]) => share >= at));
  const [low, from] = map.scale[k - 1], [high, to] = map.scale[k], part = (at - low) / (high - low);
  const mixed = [1, 3, 5].map((n) => Math.round(parseInt(from.slice(n, n + 2), 16) * (1 - part) + parseInt(to.slice(n, n + 2), 16) * part));
  return `rgb(${mixed.join(",")})`;
}

// box: {left, right, top, height}; x: time to pixels; pointed: {row, t} or null.
export function paintMap(c, map, box, x, pointed) {
  const each = box.height / map.rows.length, y = (row) => box.top + row * each;
  c.save();
  c.beginPath(); c.rect(box.left, box.top, box.right - box.left, box.height); c.clip();
  map.values.forEach((row, k) => row.forEach((value, column) => {
    if (value === null) return;
    c.fillStyle = colour(map, value);
    c.fillRect(x(map.edges[column]), y(k), x(map.edges[column + 1]) - x(map.edges[column]) + 0.5, each + 0.5);
  }));
  c.fillStyle = "#0e1116"; c.strokeStyle = "#e6edf5"; c.lineWidth = 1; // seen on dark cells and on bright ones
  for (const [row, column] of map.marked) {
    c.beginPath();
    c.arc((x(map.edges[column]) + x(map.edges[column + 1])) / 2, y(row) + each / 2, Math.min(2.5, each / 4), 0, 2 * Math.PI);
    c.fill(); c.stroke();
  }
  if (pointed) {
    const column = columnAt(map, pointed.t);
    c.strokeStyle = "#5ccfe6"; c.lineWidth = 1.5;
    c.strokeRect(x(map.edges[column]), y(pointed.row), x(map.edges[column + 1]) - x(map.edges[column]), each);
  }
  c.restore();
  c.fillStyle = TEXT; c.textAlign = "right"; c.textBaseline = "middle";
  const by = Math.max(1, Math.ceil(12 / each)); // names that would touch each other are left out
  for (let k = 0; k < map.rows.length; k += by) c.fillText(short(map.rows[k]), box.left - 6, y(k) + each / 2);
}

// What the colours mean, at the right below the panels.
export function paintScale(c, map, right, y) {
  const wide = 90, text = `${map.high} ${map.name.split(", ").at(-1)}`;
  c.textBaseline = "alphabetic"; c.fillStyle = TEXT; c.textAlign = "right";
  c.fillText(text, right, y);
  const end = right - c.measureText(text).width - 6, start = end - wide;
  const gradient = c.createLinearGradient(start, 0, end, 0);
  for (const [share, tint] of map.scale) gradient.addColorStop(share, tint);
  c.fillText("0", start - 6, y);
  c.fillStyle = gradient; c.fillRect(start, y - 9, wide, 10);
}

// A map as curves, for its table: one for each row, at the middles of the cells.
export function asLines(panel) {
  const middles = panel.map.values[0].map((_, k) => Number(((panel.map.edges[k] + panel.map.edges[k + 1]) / 2).toFixed(3)));
  return panel.map.rows.map((name, k) => ({ name: `${name}, ${panel.unit}`, t: middles, values: panel.map.values[k] }));
}
