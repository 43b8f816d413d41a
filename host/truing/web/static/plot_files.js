// A plot as files: a picture with title and legend, and its curves as a table.
import { asLines } from "/view-static/plot_map.js";
import { paint } from "/view-static/plot_paint.js";

const WIDTH = 1600, HEIGHT = 900, HEAD = 84, SCALE = 2;

export function savePicture(title, panels, range, options) {
  const canvas = document.createElement("canvas");
  canvas.width = WIDTH; canvas.height = HEIGHT;
  const c = canvas.getContext("2d");
  c.fillStyle = "#0e1116"; c.fillRect(0, 0, WIDTH, HEIGHT);
  c.scale(SCALE, SCALE);
  c.fillStyle = "#dbe3ec"; c.font = "600 16px system-ui, sans-serif"; c.fillText(title, 14, 24);
  legend(c, panels, options.hidden);
  c.translate(0, HEAD / SCALE);
  paint(c, WIDTH / SCALE, (HEIGHT - HEAD) / SCALE, panels, range, options);
  canvas.toBlob((blob) => save(blob, `${title}.png`), "image/png");
}

function legend(c, panels, hidden) {
  c.font = "12px system-ui, sans-serif";
  let x = 14;
  for (const line of keys(panels)) {
    if (hidden.has(line.name)) continue;
    c.fillStyle = line.colour; c.fillRect(x, 34, 16, 3);
    c.fillStyle = "#94a1b2"; c.fillText(line.name, x + 22, 39);
    x += 40 + c.measureText(line.name).width;
  }
}

export function keys(panels) { // one for each name
  const found = new Map();
  for (const panel of panels) for (const line of panel.lines) if (!found.has(line.name)) found.set(line.name, line);
  return [...found.values()];
}

// A row for every time of any curve within the range; an empty cell where a curve has no row at that time.
export function saveTable(title, panels, range) {
  const columns = panels.flatMap((panel) => panel.map
    ? asLines(panel).map((line) => ({ head: line.name, line }))
    : panel.lines.map((line) => ({ head: `${line.name} (${panel.unit})`, line })));
  const rows = new Map();
  columns.forEach(({ line }, column) => line.t.forEach((t, k) => {
    if (t < range[0] || t > range[1]) return;
    if (!rows.has(t)) rows.set(t, new Array(columns.length).fill(""));
    rows.get(t)[column] = line.values[k] ?? "";
  }));
  const head = ["t_s", ...columns.map(({ head: text }) => `"${text.replaceAll('"', '""')}"`)].join(",");
  const lines = [...rows].sort((a, b) => a[0] - b[0]).map(([t, values]) => [t, ...values].join(","));
  save(new Blob([[head, ...lines].join("\n") + "\n"], { type: "text/csv" }), `${title}.csv`);
}

function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name.replace(/[^\w.-]+/g, "_");
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
